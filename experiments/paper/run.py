"""The paper's three case studies for ten seeds: every figure, and the table of medians beside the targets.

    python experiments/paper/run.py [OUT] [SEEDS] [WORDS ...]

OUT is where the answers go (outputs/paper), SEEDS how many (10); WORDS are further options of `auvnn study`, such as
effort=smoke, and only=noisy,payload for some of the studies. Each study is the command
`auvnn study case=CASE seed=SEED out=OUT/CASE/SEED`, with page and figures for seed 0 (report=true: for all); one that is
there already is not run again, so that an interrupted run goes on. `table.json` holds medians and all seeds, printed as a
table, `kept.json` what `expected.json` here repeats.
"""

from __future__ import annotations

import json
import statistics
import sys
from pathlib import Path

from auvnn.cli.main import main

STUDIES = {
    "noise_free": ["case=noise_free"],
    "noisy": ["case=noisy"],
    "payload": ["case=payload"],
    # The same networks of the empty vehicle: not trained twice.
    "payload_physical": [
        "case=payload",
        "case.variant=physical",
        "case.offline.model={out}/payload/{seed}/model",
    ],
    "payload_manoeuvre": ["case=payload", "case.offline.data=manoeuvre"],
}
# Study, metric, target (at most, or at least where it ends in +), words.
TARGETS = [
    ("noise_free", "manoeuvre_rmse_over_range_worst", "0.001", "training manoeuvre, whole run"),
    ("noise_free", "manoeuvre_zero_damping_rmse_over_range_worst", "", "the same with zero damping"),
    ("noise_free", "manoeuvre_trained_held_out_multisine_rmse_over_range_worst", "", "the same, held-out multisine"),
    ("noise_free", "held_out_rmse_over_range_worst", "0.02", "trained on rich data, worst of two held-out manoeuvres"),
    ("noise_free", "rich_trained_held_out_multisine_rmse_over_range_worst", "", "the same, multisine"),
    ("noise_free", "rich_trained_held_out_manoeuvre_rmse_over_range_worst", "", "the same, the paper's manoeuvre"),
    ("noise_free", "rich_relative_residual", "", "one-step residual there, relative"),
    ("noise_free", "larger_held_out_rmse_over_range_worst", "0.01", "10 hidden units, the same"),
    ("noise_free", "larger_held_out_multisine_rmse_over_range_worst", "", "the same, multisine"),
    ("noise_free", "residual_over_best_of_50", "1.05", "residual over the best of 50 restarts (case.best_of=50)"),
    ("noise_free", "parallel_over_six_held_out_rich", "3+", "parallel over six, trained on rich data, multisine"),
    ("noise_free", "parallel_over_six_held_out_rich_on_the_manoeuvre", "3+", "the same, on the paper's manoeuvre"),
    ("noise_free", "parallel_over_six_one_step_rich", "", "the same, one-step residual"),
    ("noise_free", "parallel_over_six_held_out_manoeuvre", "3+", "trained on the paper's manoeuvre, on a multisine"),
    ("noisy", "offline_tracking_rmse_over_range_worst", "", "figure 6"),
    ("noisy", "follow_tracking_rmse_over_range_worst", "", "figure 7, weights follow (sgd)"),
    ("noisy", "guarded_tracking_rmse_over_range_worst", "", "figure 7, guarded (rls)"),
    ("noisy", "follow_frozen_over_offline", "", "frozen 5 s ahead over offline, sgd"),
    ("noisy", "guarded_frozen_over_offline", "1", "frozen 5 s ahead over offline, guarded"),
    ("noisy", "follow_global_error_over_offline", "", "damping on held-out velocities over offline, sgd"),
    ("noisy", "guarded_global_error_over_offline", "", "the same, guarded"),
    ("payload", "offline_tracking_rmse_over_range_worst", "", "figure 9"),
    ("payload", "follow_tracking_rmse_over_range_worst", "", "figure 8, weights follow (sgd)"),
    ("payload", "guarded_tracking_rmse_over_range_worst", "", "figure 8, guarded (rls)"),
    ("payload", "follow_frozen_over_offline", "", "frozen 5 s ahead over offline, sgd"),
    ("payload", "guarded_frozen_over_offline", "0.3333", "frozen 5 s ahead over offline, guarded"),
    ("payload_manoeuvre", "guarded_frozen_over_offline", "", "the same, networks trained on the manoeuvre alone"),
    ("payload_physical", "offline_tracking_rmse_over_range_worst", "", "physical variant, without online learning"),
    ("payload_physical", "guarded_tracking_rmse_over_range_worst", "", "physical variant, guarded (rls)"),
    ("payload_physical", "guarded_frozen_over_offline", "", "physical variant, frozen over offline"),
]  # fmt: skip


def run(out: Path, seeds: int, words: list[str]) -> None:
    """Run what is not there yet."""
    only = [w.removeprefix("only=").split(",") for w in words if w.startswith("only=")]
    words = [w for w in words if not w.startswith("only=")]
    for seed in range(seeds):
        for name, options in STUDIES.items():
            folder = out / name / str(seed)
            if (folder / "study.json").exists() or (only and name not in only[-1]):
                continue
            print(f"== {name}, seed {seed}", flush=True)
            drawn = [] if seed == 0 else ["report=false"]
            options = [word.format(out=out, seed=seed) for word in options]
            status = main(["study", *options, f"seed={seed}", f"out={folder}", *drawn, *words])
            if status in (130, 143):  # asked to end: not by this study alone
                raise SystemExit(status)
            if status:
                print(f"   failed with status {status}")


def table(out: Path) -> dict:
    """Return medians and all values by study and metric."""
    found: dict[str, dict[str, dict]] = {}
    for name in STUDIES:
        metrics: dict[str, dict[str, float]] = {}
        for path in sorted((out / name).glob("*/study.json"), key=lambda p: int(p.parent.name)):
            for key, value in json.loads(path.read_text())["metrics"].items():
                if value is not None:
                    metrics.setdefault(key, {})[path.parent.name] = value
        found[name] = {
            k: {"median": statistics.median(v.values()), "seeds": len(v), "all": v}
            for k, v in metrics.items()
        }
    return found


def kept(found: dict) -> dict[str, dict[str, dict[str, float]]]:
    """Return every seed's value of what the table shows, to four digits: what `expected.json` holds."""
    out: dict[str, dict[str, dict[str, float]]] = {}
    for name, key, *_ in TARGETS:
        if key in found.get(name, {}):
            values = found[name][key]["all"]
            out.setdefault(name, {})[key] = {seed: float(f"{v:.4g}") for seed, v in values.items()}
    return out


def met(value: float, target: str) -> str:
    if not target:
        return ""
    good = value >= float(target[:-1]) if target.endswith("+") else value <= float(target)
    return "met" if good else "missed"


def show(found: dict) -> None:
    """Print the table."""
    print(f"{'study':<18}{'what':<58}{'median':>10}{'min':>10}{'max':>10}{'seeds':>6}  target")
    for name, key, target, words in TARGETS:
        entry = found.get(name, {}).get(key)
        if entry is None:
            print(f"{name:<18}{words:<58}{'not run':>10}")
            continue
        numbers = (entry["median"], min(entry["all"].values()), max(entry["all"].values()))
        cells = "".join(f"{v:>10.3g}" for v in numbers)
        print(f"{name:<18}{words:<58}{cells}{entry['seeds']:>6}  {target} {met(entry['median'], target)}")


if __name__ == "__main__":
    place = Path(sys.argv[1] if len(sys.argv) > 1 else "outputs/paper")
    run(place, int(sys.argv[2]) if len(sys.argv) > 2 else 10, sys.argv[3:])
    answer = table(place)
    place.mkdir(parents=True, exist_ok=True)
    (place / "table.json").write_text(json.dumps(answer, indent=1), encoding="utf-8")
    (place / "kept.json").write_text(json.dumps(kept(answer), indent=1), encoding="utf-8")
    show(answer)
