"""One dive of a fleet: the question, and the fit of one dive alone."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from auvnn.answer_types import Dive
from auvnn.diagnosis.answers.table import values
from auvnn.diagnosis.hypotheses.candidates import (
    HORIZON,
    WARMUP,
    candidates_for,
    windows_for,
)
from auvnn.diagnosis.hypotheses.learned_drag import with_drag_only
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.residuals.autocorrelation import is_autocorrelated
from auvnn.errors import AuvnnError, InputError, one_line
from auvnn.estimation.window_normal_equations import TRUST, motion
from auvnn.improvement.commands_between import asked, one_after_another
from auvnn.log_chunks.scan import WindowCut
from auvnn.log_chunks.windows import plan_file, runs_of
from auvnn.logs import Log
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.portions import is_large, start_of
from auvnn.metrics.commands.stated import interval_of
from auvnn.models import GreyBox

_DAY = 86400.0


_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_]?([01]\d)[-_]?([0-3]\d)(?:[T_-]?([0-2]\d)[-_:]?([0-5]\d)(?:[-_:]?([0-5]\d))?)?"
)


@dataclass(frozen=True)
class Question:
    """What is asked of every dive.

    Attributes:
        model: as known.
        effects: to be fitted together with the uncertain coefficients.
        mapping: of the columns.
        window: length of the windows, s; None: 5, or less where the dive is short.
        windows: at most so many of a dive, evenly spread.
        force: go on with a log that contradicts itself, or in which nothing moves or is driven.
    """

    model: GreyBox
    effects: tuple[str, ...]
    mapping: Mapping
    window: float | None
    windows: int
    force: bool


def dive(question: Question, path: Path) -> Dive | str:
    """Return one dive's values, or why there are none: a dive that fails does not stop the others."""
    try:
        return _fitted(question, path)
    except AuvnnError as problem:
        return one_line(problem)
    except Exception as fault:
        return f"{path}: a fault of the program ({type(fault).__name__}: {one_line(fault, 200)})"


def _fitted(question: Question, path: Path) -> Dive:
    model, names = question.model, question.effects
    log = _log(question, path)
    log.quality().refuse_errors(question.force)
    _, needs = candidates_for(model, log, names)
    for name in names:
        if needs[name]:
            raise InputError(f"{path}: {name} needs {', '.join(needs[name])}, which are not there")
    windows = windows_for(model, log, question.window)
    if len(windows) < 4:
        raise InputError(f"{path}: only {len(windows)} windows of free running: the dive is too short")
    known, spread = with_drag_only(model, log)
    layout = lay_out(known, names, spread)
    found = one_after_another(layout, windows, names)
    law = asked(layout, found, windows)
    between = law.path(interval_of(windows))
    if between is not None:
        # With commands that are held the values would make up for those that are not.
        windows = law.applied(windows)
        found = one_after_another(layout, windows, names)
    start, source = start_of(path, question.mapping), "t"
    if start is None:
        start, source = _named(path), "name"
    return {
        "file": str(path),
        "start": None if start is None else datetime.fromtimestamp(start, UTC).isoformat(timespec="seconds"),
        "start_from": None if start is None else source,
        "seconds": log.duration,
        "samples": log.samples,
        "windows": len(windows),
        "verdict": "unknown" if is_autocorrelated(found, TRUST * motion(windows) + 1e-9) else "adequate",
        "cv": found.cv,
        "settled": found.fitted.converged,
        "commands": None if between is None else between.to_dict(),
        "parameters": values(layout, found, names),
        "coefficients": values(
            layout, found, [n for n in layout.nuisance if n not in (*names, *known.effect_names)]
        ),
        # Its place among the others is known once all are fitted.
        "dive": 0,
        "days": None,
    }


def _log(question: Question, path: Path) -> Log:
    """Return a dive's log; of one that is long, stretches that are evenly spread."""
    if not is_large([path]):
        return Log.read(path, question.mapping)
    horizon = HORIZON if question.window is None else float(question.window)
    cut = WindowCut(horizon, WARMUP, question.model.actuation, question.mapping)
    return Log.from_runs(runs_of(plan_file(cut, path).spread(question.windows), cut), path.stem)


def _named(path: Path) -> float | None:
    """Return the date in a file's name, s since 1970, None without one."""
    match = _DATE.search(path.stem)
    if match is None:
        return None
    try:
        return datetime(*(int(g or 0) for g in match.groups()), tzinfo=UTC).timestamp()  # type: ignore[misc]
    except ValueError:
        return None
