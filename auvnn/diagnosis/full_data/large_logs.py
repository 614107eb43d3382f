"""Diagnosis of logs larger than memory, and of many files: a search on a sample, and its answer put to everything.

The search refits candidates dozens of times, and cross-validates each; its cost is that of many passes. A name needs
no more data than a few hundred windows hold, however long the log. So:

1. *Plan.* One pass through the files finds all windows of free running (`metrics.parts`).
2. *Search.* The search of `diagnose`, unchanged, runs on stretches of neighbouring windows that are evenly spread over
   all files, `search` windows in all; where the log has no more than that, on all of them, and then the answer is that
   of `diagnose` to the last digit.
3. *Look.* The leading effects are tested at the null on `windows` windows, evenly spread, or on all: a map over parts,
   each reduced to sums, and the sums added in the order of the parts. By all windows there are, p-values and one-step
   estimates of effects that the sample could have missed.
4. *Fit.* What was found is fitted to the same windows, with standard errors by all of them, and asked whether what it
   leaves is white.

Every figure says how many windows are behind it. Time is linear in the samples: reading alone for the first step, some
a dozen runs through each window for the last two. Memory is that of a portion and of the sample, whatever the log.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.answer_types import SearchedPart
from auvnn.answers import plain
from auvnn.diagnosis.answers.answer import Diagnosis
from auvnn.diagnosis.answers.describe_parameters import describe_parameters as parameters_told
from auvnn.diagnosis.diagnose import searched
from auvnn.diagnosis.full_data.full_data import Refit, ScoreTests, refit, score_tests
from auvnn.diagnosis.full_data.map_reduce import LinearisationPoint, MapReduce
from auvnn.diagnosis.hypotheses.candidates import HORIZON, WARMUP, check_window_length
from auvnn.diagnosis.hypotheses.stated_priors import Layout, lay_out
from auvnn.diagnosis.score_tests.null_tests import bonferroni
from auvnn.diagnosis.stages.state import Searched
from auvnn.errors import ConfigError, InputError
from auvnn.estimation.priors import set_parameters
from auvnn.executors import Executor, executor_for
from auvnn.log_chunks.scan import Plan, WindowCut
from auvnn.log_chunks.windows import concatenate_windows, plan_file, runs_of
from auvnn.logs import Log
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.portions import log_files
from auvnn.models import GreyBox
from auvnn.progress import Progress
from auvnn.threads import on_one_thread

# Windows for the search, and for the look and the fit; effects of the catalogue that are looked at beside those found.
SEARCH, WINDOWS, LEADING = 240, 1000, 8


@on_one_thread
def diagnose_files(
    model: GreyBox,
    log: str | Path | Sequence[str | Path],
    effects: str | Sequence[str] | None = None,
    *,
    mapping: Any = None,
    max_effects: int = 4,
    window: float | None = None,
    search: int = SEARCH,
    windows: int | None = WINDOWS,
    leading: int | None = LEADING,
    workers: int = 1,
    executor: str | None = None,
    address: str | None = None,
    advice: bool = True,
    force: bool = False,
    tolerance: Any = None,
    costs: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Say which physical effects a model lacks, by files of any size and number; see the module's text.

    Args:
        model: the model as known.
        log: a file, a folder, a pattern, or a list of these.
        effects: names to consider; the whole catalogue by default.
        mapping: how the files' columns are named.
        max_effects: look for at most this many.
        window: length of the windows, s; by default 5.
        search: windows that the search takes.
        windows: windows for the tests and the fit on the whole; None: all of them.
        leading: how many effects are tested on the whole, beside those that were found; None: all.
        workers: processes.
        executor: who computes: `serial`, `processes`, `ray` or `dask`.
        address: of a Ray or Dask cluster that is running.
        advice: for an ambiguous answer, also work out which manoeuvre would tell the candidates apart.
        force: go on with a log that contradicts itself, or in which nothing moves or is driven.
        tolerance: what does not matter, as in `diagnose`.
        costs: also work out what each name costs.
        progress: called with what is being done, in words.

    Returns:
        the diagnosis; `whole_log` holds what all of the log says.

    Raises:
        ConfigError: an unknown effect or executor, or a number that cannot be.
        InputError: the files have too little that can be used, or contradict themselves.

    Example:
        ```python
        diagnosis = auvnn.diagnose_files(auvnn.load("rov95"), "dives/*.parquet", workers=8)
        diagnosis.whole_log  # what all of the log says
        ```
    """
    say = progress or (lambda words: None)
    check_window_length(window)
    for name, value in (("search", search), ("windows", windows), ("leading", leading)):
        if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 1):
            raise ConfigError(f"{name}={value} must be a whole number, at least 1")
    if model.vehicle.reduced or model.vehicle.glides:
        raise ConfigError(f"{model.vehicle.name} is a reduced model: its log is read whole, stream=false")
    paths = log_files([log] if isinstance(log, (str, Path)) else log)
    plan_ = Mapping.read(mapping)
    cut = WindowCut(HORIZON if window is None else float(window), WARMUP, model.actuation, plan_)
    with executor_for(executor, workers, address) as pool:
        plan = _planned(pool, paths, cut, say)
        sample, told = _sample(plan, paths, cut, search)
        # What `check` calls an error, as far as the sample shows it.
        sample.quality().refuse_errors(force)
        found, under_way = searched(
            model,
            sample,
            effects,
            max_effects=max_effects,
            window=window,
            advice=advice,
            force=force,
            tolerance=tolerance,
            costs=costs,
            # The tests on more windows that follow hold the force for noise as the windows show it.
            stochastic=False,
            pool=pool,
            progress=say,
        )
        parts = plan.spread(windows)
        passes = MapReduce(pool, parts, say)
        asked = _leading(found, under_way, leading)
        looked, layout = _score_all(passes, model, under_way, asked, cut)
        last = found.explanation
        assert last is not None  # a search always ends with one
        fitted = refit(
            passes, layout_with(under_way, last.effects), last, under_way.extent, cut, under_way.floor
        )
    more = [f"and {len(plan.notes) - 5} more stretches of rows left out"] if len(plan.notes) > 5 else []
    return replace(
        found,
        whole_log=_describe(plan, len(paths), sum(map(len, parts)), told, looked, layout, fitted, found),
        warnings=[*found.warnings, told["words"], *plan.notes[:5], *more],
    )


def _plan_one(cut: WindowCut, path: Path) -> Plan | InputError:
    try:
        return plan_file(cut, path)
    except InputError as problem:
        return problem


def _planned(pool: Executor, paths: Sequence[Path], cut: WindowCut, say: Callable[[str], None]) -> Plan:
    good, bad = [], []
    answers = zip(paths, pool.run(_plan_one, cut, list(paths)), strict=True)
    for k, (path, found) in enumerate(answers, 1):
        say(Progress(f"looking through {path}", k, len(paths)))
        (bad if isinstance(found, InputError) else good).append(found)
    # One file alone that cannot be read is the user's; one of many is left out and reported.
    if not good:
        raise bad[0]
    plan = concatenate_windows(good)
    return Plan(plan.parts, plan.samples, plan.duration, plan.runs, (*map(str, bad), *plan.notes))


def _sample(plan: Plan, paths: Sequence[Path], cut: WindowCut, most: int) -> tuple[Log, SearchedPart]:
    """Return the log on which the search runs, and how it was chosen."""
    name = paths[0].stem if len(paths) == 1 else f"{paths[0].stem} and {len(paths) - 1} more"
    some = plan.spread(most)
    count = sum(map(len, some))
    if count == plan.windows and not plan.notes:
        whole = Log.read(paths if len(paths) > 1 else paths[0], cut.mapping)
        words = f"the search ran on all {count} windows"
        return whole, {
            "windows": count,
            "stretches": len(whole.runs),
            "seconds": whole.duration,
            "words": words,
        }
    runs = runs_of(some, cut)
    seconds = sum(r.duration for r in runs)
    words = (
        f"the search ran on {count} of {plan.windows} windows: {len(runs)} stretches, evenly spread, {seconds:.0f} s of "
        f"{plan.duration:.0f} s"
    )
    return Log.from_runs(runs, name), {
        "windows": count,
        "stretches": len(runs),
        "seconds": seconds,
        "words": words,
    }


def _leading(found: Diagnosis, under_way: Searched, count: int | None) -> list[str]:
    """Return the effects to test on the whole: those found, and those that led on the sample."""
    tested = [c["effect"] for c in found.candidates if c["p_value"] is not None]
    tested = [n for n in tested if n in under_way.usable and n not in under_way.silent]
    last = found.explanation.effects if found.explanation is not None else ()
    first = list(dict.fromkeys([*found.missing, *last]))
    return [*first, *[n for n in tested if n not in first][: count if count is not None else len(tested)]]


def layout_with(under_way: Searched, names: Sequence[str]) -> Layout:
    """Return the search's layout with none of the candidates in it but those named."""
    whole = under_way.layout
    keep = [*under_way.base, *names]
    effects = [e for e in whole.model.copied_effects() if str(e.name) in keep]
    bare = [e for e in effects if str(e.name) not in names or str(e.name) in under_way.base]
    model = whole.model.sharing(bare)
    laid = lay_out(model, names, whole.spreads.get("learned_drag"))
    # What was stated of each stays what was stated, whatever has been fitted since.
    means = {n: whole.means[n] for n in laid.names}
    return Layout(laid.model, laid.names, laid.columns, laid.nuisance, means, whole.spreads)


def _score_all(
    passes: MapReduce, model: GreyBox, under_way: Searched, asked: list[str], cut: WindowCut
) -> tuple[ScoreTests, Layout]:
    layout, null = layout_with(under_way, asked), under_way.first
    assert null is not None  # the search has run
    set_parameters(layout.model, null.names, null.fitted.theta)
    point = LinearisationPoint(layout, tuple(asked), under_way.extent, None, null.fitted.sigma, cut)
    return score_tests(passes, point, under_way.base, asked), layout


def _describe(
    plan: Plan,
    files: int,
    count: int,
    told: SearchedPart,
    looked: ScoreTests,
    layout: Layout,
    fitted: Refit,
    found: Diagnosis,
) -> dict[str, Any]:
    """Return what all of the log says, as the answer holds it."""
    rows = []
    for name, score in looked.scores.items():
        rows.append({
            "effect": name,
            "p_value": score.p_value,
            "evidence": score.evidence,
            "inflation": score.inflation,
            "parameters": parameters_told(layout.model.effect(name), score.estimate, score.std),
        })  # fmt: skip
    tests = [s.p_value for s in looked.scores.values() if s.degrees]
    effects = found.explanation.effects if found.explanation is not None else ()
    sums = fitted.sums
    usable = np.isfinite(found.explanation.fitted.sigma) if found.explanation is not None else slice(None)
    return plain({
        "files": files,
        "runs": plan.runs,
        "samples": plan.samples,
        "seconds": plan.duration,
        "windows": plan.windows,
        "searched": told,
        "looked_at": count,
        "global_p_value": bonferroni(tests),
        "candidates": sorted(rows, key=lambda r: -r["evidence"]),
        "parameters": fitted.values(layout, [n for n in effects if n not in found.unsure]),
        "coefficients": fitted.values(layout, [n for n in fitted.names if n not in effects]),
        "misfit": float(np.sqrt(sums.cost / max(sums.count[usable].sum(), 1.0))),
        "adequate": not fitted.lasting,
        "steps": fitted.steps,
        "settled": fitted.settled,
    })  # fmt: skip
