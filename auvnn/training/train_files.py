"""Training on logs larger than the memory, and on many files: the fit of `train`, its sums spread over workers.

1. *Plan.* One pass through the files cuts them into pieces of some ten thousand samples, and decides as `Log.split`
   does what is fitted, what decides when to stop, and what is held out.
2. *Targets.* A map over the pieces: what the subnetworks should give, kept in a scratch folder.
3. *Fit.* Each iteration is three maps over groups of samples: the sums for the output layers, the squared errors, and
   the normal equations of all weights. They are added in a fixed order, so that the answer does not depend on who
   computed them, nor on who died meanwhile.
4. *Held out.* A map over the pieces of the test.

Memory is that of a piece and of a few groups, whatever the log; time is linear in the samples. What needs the log in one
place (its quality, and whether something that is not damping was learned) is judged on a sample, evenly spread, and the
answer says about how many.
"""

from __future__ import annotations

import contextlib
import copy
import tempfile
from collections.abc import Iterator, Sequence
from collections.abc import Mapping as Dict
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.executors import Executor, executor_for
from auvnn.log_chunks.samples import Pieces, Reading, evenly_spread_runs
from auvnn.logs import Log
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import carried_over
from auvnn.progress import Progress
from auvnn.threads import on_one_thread
from auvnn.training.confounding.confounded_effects import confounded_effects
from auvnn.training.distributed.data_split import (
    DataSplit,
    Say,
    named,
    paths_of,
    plan_files,
    refuse_leakage,
    split_data,
)
from auvnn.training.distributed.distributed_problem import DistributedProblem
from auvnn.training.distributed.grouped_sums import GROUP
from auvnn.training.distributed.target_cache import Source
from auvnn.training.figures import history_of, metrics_of
from auvnn.training.fit_damping import build_scheme, fit_damping, most_iterations
from auvnn.training.held_out import score
from auvnn.training.history import Record
from auvnn.training.objectives.base import build_objective
from auvnn.training.train import Training

# Samples that are looked at in one place.
LOOKED_AT = 20_000


def spreads(
    scheme: str | Dict[str, Any] = "levenberg_marquardt", objective: str | Dict[str, Any] = "one_step"
) -> bool:
    """Return whether a training by this scheme, on this objective, can be spread: it asks for sums alone.

    Raises:
        ConfigError: an unknown scheme, objective or option.
    """
    return build_scheme(scheme).sums_suffice and build_objective(objective).name == "one_step"


@on_one_thread
def train_files(
    model: GreyBox,
    log: str | Path | Sequence[str | Path],
    scheme: str | Dict[str, Any] = "levenberg_marquardt",
    damping: str | Dict[str, Any] = "mlp",
    *,
    objective: str | Dict[str, Any] = "one_step",
    test: str | Path | Sequence[str | Path] | None = None,
    mapping: Any = None,
    seed: int = 0,
    derivative: Dict[str, Any] | None = None,
    checkpoint: str | Path | None = None,
    resume: bool | Literal["force"] = False,
    force: bool = False,
    workers: int = 1,
    executor: str | None = None,
    address: str | None = None,
    scratch: str | Path | None = None,
    group: int = GROUP,
    progress: Say | None = None,
) -> Training:
    """Train damping subnetworks on files of any size and number; see the module's text, and `train`.

    Args:
        model: the model; it is not changed.
        log: what to fit on: a file, a folder, a pattern, or a list of these.
        scheme: a training scheme that asks for sums alone, `levenberg_marquardt`, or its options with `scheme`.
        damping: form of the subnetworks, or options with `form`.
        objective: `one_step`; free running needs the log in memory.
        test: held out; by default the last run of `log`, or the last 30 % of a single one.
        mapping: how the files' columns are named.
        seed: of initial weights.
        derivative: how accelerations are obtained where they were not measured.
        checkpoint: folder of checkpoints, from which `resume` goes on, bit for bit.
        resume: go on from the newest checkpoint; "force" even where data or options have changed.
        force: go on with a log that contradicts itself: signs, units, axes.
        workers: processes.
        executor: who computes: `serial`, `processes`, `ray` or `dask`.
        address: of a Ray or Dask cluster that is running.
        scratch: folder for what is worked out once, 96 bytes a sample, emptied at the end; a temporary one by default.
            Workers on other machines share it if they can see it.
        group: samples whose sums are made in one place. The answer is that of `train` to the last bit where this is
            left as it is.
        progress: called with what is being done, in words.

    Raises:
        ConfigError: an unknown scheme, form, option or executor, or one that cannot be spread.
        InputError: nothing to fit, the same data on both sides, or a log that contradicts itself.

    Example:
        ```python
        trained = auvnn.train_files(auvnn.load("rov95"), "dives/*.parquet", test="held_out.parquet", workers=8)
        trained.model.save("trained")
        ```
    """
    say = progress or (lambda words: None)
    if not spreads(objective=objective):
        raise ConfigError(
            "training on free running needs the log in memory: leave objective= out, read less of it (max_duration=), "
            "or say stream=false"
        )
    if not spreads(scheme):
        raise ConfigError(
            f"scheme {build_scheme(scheme).name} needs the log in memory: take levenberg_marquardt, or say stream=false"
        )
    plan = Mapping.read(mapping)
    half = dict(derivative or {}).get("half_width")
    reading = Reading(plan, None if half is None else int(half))
    bank = DampingBank.from_description(damping, seed)
    paths = paths_of(log)
    name = named(paths)
    test_name = name if test is None else named(paths_of(test))
    with (
        executor_for(executor, workers, address) as pool,
        _made(scratch) as place,
        tempfile.TemporaryDirectory(prefix="auvnn-", dir=place) as folder,
    ):
        whole = plan_files(pool, paths, reading, say)
        tested = None if test is None else plan_files(pool, paths_of(test), reading, say)
        shares, how = split_data(whole, tested, derivative, plan, name, test_name)
        if tested is not None:
            say("comparing the test log with the log that is fitted")
            refuse_leakage(pool, whole, tested, plan)
        looked = _sample(shares.fitted, plan, name)
        for some in (looked, *([] if tested is None else [_sample(tested, plan, test_name)])):
            some.quality().refuse_errors(force)
        problem, held = _problem(pool, Source.of(model, how, plan, Path(folder)), shares, group, say)

        most = most_iterations(scheme)

        def told(record: Record) -> None:
            words = f"iteration {record.iteration}: worst relative error {record.worst:.3g}"
            say(Progress(words, record.iteration, max(most, record.iteration), rough=True))

        own = copy.deepcopy(bank)
        fit = fit_damping(
            own,
            problem,
            scheme=scheme,
            held_out=[held],
            seed=seed,
            callback=told,
            checkpoint_folder=checkpoint,
            resume=resume if checkpoint is not None else False,
        )
        own.requires_grad_(True)
        trained = carried_over(GreyBox(model.vehicle, model.copied_effects(), own, model.actuation), model)
        say("the held-out part")
        before, after = score(pool, shares.test.pieces, [model, trained], how, plan)
    worse = [n for n in after if after[n]["rmse"] > before[n]["rmse"] * (1 + 1e-9)]
    warnings = [*model.vehicle.warnings, *looked.quality().reservations, *fit.warnings, *whole.notes[:5]]
    if len(whole.notes) > 5:
        warnings.append(f"and {len(whole.notes) - 5} more stretches of rows left out")
    if worse:
        warnings.append(f"held out, one step ahead, {', '.join(worse)} got worse by the training")
    absorbed = confounded_effects(trained, looked, how)
    warnings += [] if absorbed is None else absorbed.words()
    return Training(
        model.vehicle.name,
        name,
        test_name,
        fit.scheme,
        bank.describe(),
        seed,
        metrics_of(fit, before, after, shares.fitted.samples, shares.stopping.samples),
        history_of(fit),
        fit.stopped_because,
        {**how.describe(whole.dt()), "held_out": shares.held_words, "stopping": shares.stop_words},
        trained,
        warnings,
        [] if absorbed is None else absorbed.surfaces,
        {"objective": "one_step"},
        absorbed,
        {
            "files": len(paths),
            "runs": len(whole.runs),
            "samples": whole.samples,
            "seconds": whole.duration,
            "pieces": len(whole.pieces),
            "groups": len(problem.split([held])[0].groups),
            "looked_at": looked.samples,
        },
    )


@contextlib.contextmanager
def _made(scratch: str | Path | None) -> Iterator[Path | None]:
    """Make the scratch folder, and take it away again where nothing is left in it."""
    if scratch is None:
        yield None
        return
    place = Path(scratch)
    place.mkdir(parents=True, exist_ok=True)
    try:
        yield place
    finally:
        with contextlib.suppress(OSError):
            place.rmdir()


def _sample(pieces: Pieces, mapping: Mapping, name: str) -> Log:
    return Log.from_runs(evenly_spread_runs(pieces, LOOKED_AT, mapping), name)


def _problem(
    pool: Executor, source: Source, shares: DataSplit, size: int, say: Say
) -> tuple[DistributedProblem, int]:
    """Return the one-step problem, and the run number of what decides when to stop."""
    held = max(shares.fitted.runs) + 1
    stopping = [replace(p, run=held) for p in shares.stopping.pieces]
    pieces = [*shares.fitted.pieces, *stopping]
    say(f"what the subnetworks should give: {len(pieces)} pieces")
    return DistributedProblem.of(pool, source, pieces, size), held
