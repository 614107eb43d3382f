"""The modules of the study on public simulators, for its tests: they stand outside of the package."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parents[2] / "experiments" / "public_simulator"
VEHICLES = ("remus", "bluerov2", "girona500")
MODULES = ("run", "logged", *VEHICLES, *(f"{vehicle}_changes" for vehicle in VEHICLES), "BlueROV2")


@contextmanager
def studied(*checkouts: Path) -> Iterator[Any]:
    """Give the study's script as a module, and forget it and what it has imported afterwards.

    Args:
        checkouts: folders that the study puts into the search path.
    """
    before = set(sys.modules)
    sys.path.insert(0, str(HERE))
    try:
        # Other studies have a script of that name, too.
        sys.modules.pop("run", None)
        import run

        yield run
    finally:
        sys.path[:] = [p for p in sys.path if p not in {str(HERE), *map(str, checkouts)}]
        for name in set(sys.modules) - before | {"run"}:
            if name in MODULES or name.startswith("python_vehicle_simulator"):
                sys.modules.pop(name, None)


def shows_in_the_motion_alone(study: Any, module: Any) -> None:
    """Check that each change moves the vehicle, that commands are first the same, and that runs can be had again.

    Args:
        study: plant and changes.
        module: of the simulator.
    """
    plain = study.plant(module).run(3)
    for name, changed in study.changes.items():
        other = study.plant(module, **changed).run(3)
        moved = np.abs(other - plain)[:, 5:14].max()
        assert moved > 0.003 if name != "nothing" else moved == 0.0, name
        np.testing.assert_array_equal(other[0, 14:], plain[0, 14:])
    half = len(plain) // 2
    again = study.plant(module, **study.changes["payload"])
    np.testing.assert_array_equal(again.run(3), again.run(3))
    np.testing.assert_array_equal(again.run(3)[:half], plain[:half])


def told_is_what_came_out(study: Any, page: str, files: Mapping[str, str]) -> None:
    """Check that a page's table and counts are those of the answers that are kept.

    Args:
        study: changes, and names that are true of them besides.
        page: its name, without its ending.
        files: words that a count begins with to the ending of the file of answers, in the order of the table's columns.
    """
    text = (HERE / f"{page}.md").read_text()
    answers = [
        {r["hidden"]: r for r in json.loads((HERE / f"expected-{page}{which}.json").read_text())}
        for which in files.values()
    ]
    rows = {
        cells[0].strip("`"): cells[1:]
        for line in text.splitlines()
        if line.startswith("| ") and len(cells := line.strip("| ").split(" | ")) == len(files) + 4
    }
    rows.pop("hidden")
    assert set(rows) == set(study.changes) and all(set(a) == set(study.changes) for a in answers)
    right = {n: {n, *study.also.get(n, ())} - {"nothing"} for n in rows}
    for name, cells in rows.items():
        for answer, said in zip(answers, cells[: len(files)], strict=True):
            words = [
                [f"**`{e}`**" if e in right[name] else f"`{e}`" for e in g] for g in answer[name]["groups"]
            ]
            assert said == (", then ".join(map(" or ".join, words)) or answer[name]["verdict"]), name
        *_, errors, seconds = cells
        assert errors == ", ".join(f"{a[name]['error']:.2f}" for a in answers)
        assert seconds == ", ".join(f"{a[name]['seconds']:.0f}" for a in answers)
    for words, answer in zip(files, answers, strict=True):
        first = {n: {*(r["groups"] or [[]])[0]} for n, r in answer.items()}
        hits = [n for n in answer if right[n] & first[n]]
        wrong = [n for n in answer if first[n] and not right[n] & first[n]]
        alone = sum(len(first[n]) == 1 for n in hits)
        assert (
            f"- {words}: {len(hits)} of {len(answer) - 1} are named first, {alone} of them alone, and a wrong name comes "
            f"first in {len(wrong)} of {len(answer)}." in text
        )
