"""The hidden-effect benchmark by its plan: tables and figures in one go.

    python experiments/hidden_effects/run.py [OUT] [--plan full] [--readme] [WORDS ...]

OUT is where the answer goes (outputs/hidden_effects). The command is `auvnn benchmark plan=PLAN out=OUT WORDS`, such as
only=[pairs] or workers=2; an interrupted run goes on, and one that is complete is not run again. Beside what the command
writes, OUT gets `tables.md`, and `summary.json` with everything but the rows, which are in `rows.jsonl`, bad ones too.
With --readme the tables also go into the README beside this file, and the figures into `figures/` there.
"""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from auvnn.answers import write_text
from auvnn.cli.main import main

HERE = Path(__file__).resolve().parent
BEGIN, END = "<!-- results -->", "<!-- /results -->"
FIGURES = {
    "confusion": "What was hidden (rows) and what was answered first (columns)",
    "recovery": "How often the hidden effect is named first, by effect and size",
    "coverage": "Errors of the parameters in their own standard errors",
    "uniformity": "P-values of all tests on logs that hide nothing",
    "falls": "Fall of the held-out 5 s error, as a share of what the truth gives",
}


def share(entry: Mapping[str, Any] | None) -> str:
    """Return a share in per cent with its interval."""
    if not entry or entry.get("share") is None:
        return "–"
    words = f"{100 * entry['share']:.1f} %"
    if entry.get("low") is not None:
        words += f" ({100 * entry['low']:.1f} to {100 * entry['high']:.1f})"
    return words


def wanted(aim: Mapping[str, Any]) -> str:
    """Return what a target asks for."""
    ends = [f"{word} {100 * aim[key]:g} %" for key, word in (("least", "at least"), ("most", "at most"))
            if aim.get(key) is not None]  # fmt: skip
    return ", ".join(ends)


def smallest(found: Mapping[str, Any]) -> str:
    """Return the size that is found nine times in ten, or why there is none."""
    if not found["determined"]:
        return str(found["words"])
    return f"{found['size']:.2g} ({found['low']:.2g} to {found['high']:.2g})"


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def tables(answer: Mapping[str, Any]) -> str:
    """Return targets, rates by part and rates by effect in Markdown."""
    met = {True: "met", False: "**missed**", None: "not measured"}
    aims = [[a["part"], a["rate"], wanted(a), share(a), a["count"], met[a["met"]]] for a in answer["targets"]]
    rates = [[r["part"], r["rate"], share(r), "–" if r["hits"] is None else r["hits"], r["count"]]
             for r in answer["rates"]]  # fmt: skip
    effects = [
        [
            f"`{e['effect']}`", e["logs"], share(e["named_first"]), share(e["named_alone"]),
            share(e["named_or_in_group"]), share(e["named_or_tied"]), smallest(e["size_90"]),
            f"{e['intervals']['hits']} of {e['intervals']['count']}",
            "–" if e["exact_ties"] is None else f"{100 * e['exact_ties']:.0f} %",
            "–" if e["median_fall"] is None else f"{100 * e['median_fall']:.0f} %",
        ]
        for e in answer["effects"]
    ]  # fmt: skip
    parts = [
        ("Targets", table(["part", "rate", "wanted", "found (95 % interval)", "of", "verdict"], aims)),
        ("Rates by part", table(["part", "rate", "share (95 % interval)", "hits", "of"], rates)),
        ("Single effects", table(
            ["effect", "logs", "named first", "alone", "or in a declared group", "or in a tied group",
             "size found in 90 %", "95 % intervals right", "exact ties", "held-out fall, median"], effects)),
    ]  # fmt: skip
    warned = "".join(f"\nNote: {words}.\n" for words in answer["warnings"])
    logs = f"{answer['metrics']['logs']} logs, {answer['metrics']['faults']} faults.\n{warned}"
    return "\n\n".join([logs, *(f"### {title}\n\n{text}" for title, text in parts)]) + "\n"


def into_readme(text: str, out: Path, readme: Path) -> None:
    """Put tables and figures between the marks of a README, in the place of what stood there."""
    before = readme.read_text(encoding="utf-8")
    head, _, rest = before.partition(BEGIN)
    tail = rest.partition(END)[2]
    pictures = []
    for name, words in FIGURES.items():
        source = out / "figures" / f"{name}.png"
        if source.exists():
            target = readme.parent / "figures" / source.name
            target.parent.mkdir(exist_ok=True)
            shutil.copyfile(source, target)
            pictures.append(f"![{words}](figures/{source.name})")
    body = "\n\n".join([text.rstrip("\n"), *pictures])
    write_text(readme, f"{head}{BEGIN}\n{body}\n{END}{tail}")


def run() -> int:
    """Run the plan where it has not been run, and write what is to be read."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", nargs="?", default="outputs/hidden_effects")
    parser.add_argument("--plan", default="full")
    parser.add_argument("--readme", action="store_true")
    given, words = parser.parse_known_args()
    out = Path(given.out)
    if not (out / "benchmark.json").exists():
        status = main(["benchmark", f"plan={given.plan}", f"out={out}", *words])
        if status != 0:
            return status
    answer = json.loads((out / "benchmark.json").read_text(encoding="utf-8"))
    text = tables(answer)
    write_text(out / "tables.md", text)
    write_text(out / "summary.json", json.dumps({k: v for k, v in answer.items() if k != "rows"}, indent=1))
    if given.readme:
        into_readme(text, out, HERE / "README.md")
    print(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(run())
