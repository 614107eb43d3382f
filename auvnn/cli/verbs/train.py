"""`auvnn train`: train the damping subnetworks on a log."""

from __future__ import annotations

from typing import Any

from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.folder import WORK
from auvnn.cli.runs.job import Answering, Job, Verb, files
from auvnn.cli.runs.working import take_away
from auvnn.errors import ConfigError


def _run(job: Job) -> Answering:
    try:
        training = _in_parts(job) if _parted(job) else _in_memory(job)
    except KeyboardInterrupt as end:
        if job.checkpoint.is_dir():
            raise type(end)(f"go on by the same command with out={job.out} resume=true") from None
        raise
    training.model.save(job.folder / "model")
    training.write(job.folder)
    data = training.to_dict()
    said = "assumed" if job["test"] is None else "test"
    job.say(f"{said:<9} {data['derivative']['held_out']}")
    job.warn([warning for warning in data["warnings"] if warning not in training.model.vehicle.warnings])
    job.say(f"trained   {data['metrics']['iterations']} iterations: {data['stopped']}")
    for when in ("before", "after"):
        scores = {n: data["metrics"][f"held_out_r2_{n}_{when}"] for n in ("du", "dv", "dw", "dp", "dq", "dr")}
        shown = ", ".join(f"{n} {'unknown' if v is None else format(v, '.3f')}" for n, v in scores.items())
        job.say(f"result    held-out one-step R2 {when}: {shown}")
    free = [data["metrics"].get(f"held_out_rollout_5_s_total_{when}") for when in ("one_step", "after")]
    if None not in free:
        job.say(f"result    held-out free running over 5 s: {free[0]:.4g} one step, {free[1]:.4g} rollout")
    return training


def _parted(job: Job) -> bool:
    """Say whether the log is read in parts: as told, or where it is large and the fit can be spread."""
    from auvnn.logs.reading.portions import is_large
    from auvnn.training.train_files import spreads

    if job["stream"] is not None or job["max_duration"] is not None:
        return bool(job["stream"])
    return spreads(job["scheme"], job["objective"]) and is_large(files(job.options, "log"))


def _in_memory(job: Job) -> Any:
    from auvnn.training import train

    log, test = job.log(partial=True), job.held_out(partial=True)
    return train(job.model(log), log, test=test, **_options(job))


def _in_parts(job: Job) -> Any:
    from auvnn.logs.reading.portions import kinds_of
    from auvnn.training import train_files

    if job["max_duration"] is not None:
        raise ConfigError("max_duration= reads the beginning of each file: leave it out, or say stream=false")
    paths, mapping = files(job.options, "log"), job.mapping()
    test = None if job["test"] is None else files(job.options, "test")
    job.say(f"log       {len(paths)} files, read in parts by {job['workers']} workers")
    shared = {key: job[key] for key in ("workers", "executor", "address")}
    return train_files(job.model(kinds=kinds_of(paths, mapping)), paths, test=test, mapping=mapping,
                       scratch=job.out / WORK / "samples", **shared, **_options(job))  # fmt: skip


def _options(job: Job) -> dict[str, Any]:
    if job["overwrite"] and not job["resume"]:
        take_away(job.checkpoint)
    same = {key: job[key] for key in ("scheme", "damping", "objective", "seed", "derivative", "force")}
    return {**same, "checkpoint": job.checkpoint, "resume": bool(job["resume"]), "progress": job.say.progress}


VERB = Verb(
    "train the damping subnetworks on a log", ("log", "mapping", "model", "test"),
    ("training.json", "model/", "report.html", "figures/"), _run, dry_run=check_inputs,
)  # fmt: skip
