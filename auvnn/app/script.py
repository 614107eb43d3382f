"""The commands and the Python script that do what was done on the page."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Told:
    """What was done.

    Attributes:
        model: name or path of the model at the beginning.
        kind: "thrusters" or "wrench", by which it is driven.
        steps: effects that were added and kept, in order; an empty step is a walk of the whole loop.
        diagnosed: whether a diagnosis was made.
        separate: whether a log was held out.
    """

    model: str
    kind: str
    steps: tuple[tuple[str, ...], ...]
    diagnosed: bool
    separate: bool


def commands(told: Told, folder: Path) -> str:
    """Return shell commands; they read the logs that are saved in `folder`."""
    model = told.model
    quote = shlex.quote
    lines = [
        "#!/bin/sh",
        "# Does again what was done on the page of auvnn app. log.parquet is what was fitted on,",
        "# test.parquet what was held out; both are in this folder.",
        f"cd {quote(str(folder))}",
        "auvnn check log=log.parquet out=again/check",
        f"auvnn compare model={quote(model)} log=log.parquet out=again/compare",
    ]
    if told.diagnosed:
        lines.append(f"auvnn diagnose model={quote(model)} log=log.parquet out=again/diagnose")
    test = " test=test.parquet" if told.separate else ""
    for number, effects in enumerate(told.steps, 1):
        if not effects:
            out = f"again/improve_{number}"
            lines.append(f"auvnn improve model={quote(model)} log=log.parquet{test} out={out}")
            model = f"{out}/model"
            continue
        out = f"again/add_{number}"
        effect = effects[0] if len(effects) == 1 else quote(f"[{','.join(effects)}]")
        again = " refit=true" if _may_be_there(told, number) else ""
        lines.append(f"auvnn add model={quote(model)} log=log.parquet{test} effect={effect}{again} out={out}")
        model = f"{out}/model"
    return "\n".join(lines) + "\n"


def _may_be_there(told: Told, number: int) -> bool:
    """Whether the model may have an effect already that a step fits: from its file, or from an earlier step."""
    earlier = {e for effects in told.steps[: number - 1] for e in effects}
    whole_loop = any(not effects for effects in told.steps[: number - 1])
    return Path(told.model).exists() or whole_loop or bool(earlier & {*told.steps[number - 1]})


def python(told: Told) -> str:
    """Return a Python script; it reads the logs that lie beside it."""
    lines = [
        '"""Does again what was done on the page of auvnn app: log.parquet was fitted on, test.parquet held out."""',
        "",
        "from pathlib import Path",
        "",
        "import auvnn",
        "",
        "here = Path(__file__).parent",
        'log = auvnn.Log.read(here / "log.parquet")',
    ]
    if told.separate:
        lines.append('test = auvnn.Log.read(here / "test.parquet")')
    lines += [
        "for finding in log.quality().findings:",
        '    print(f"{finding.level}: {finding.where}: {finding.what}")',
        "",
        f"model = auvnn.load({told.model!r}, actuation={told.kind!r})",
        'print(auvnn.compare(model, log).rollout["5"]["total"])',
    ]
    if told.diagnosed:
        lines += ["", "diagnosis = auvnn.diagnose(model, log)", 'print("\\n".join(diagnosis.story))']
    test = ", test=test" if told.separate else ""
    for number, effects in enumerate(told.steps, 1):
        again = ", refit=True" if _may_be_there(told, number) else ""
        lines += [
            "",
            f"better = auvnn.add(model, log, {list(effects)!r}{test}{again})"
            if effects
            else f"better = auvnn.improve(model, log{test})",
            "print(better.waterfall)",
            "model = better.model",
        ]
    if told.steps:
        lines += ["", 'model.save(here / "again" / "model")']
    return "\n".join(lines) + "\n"
