"""`auvnn train`: train the damping subnetworks on a log."""

from __future__ import annotations

import shutil

from auvnn.cli.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.training import train

    log, test = job.log(), job.held_out()
    model = job.model(log)
    if job["overwrite"] and not job["resume"]:
        shutil.rmtree(job.checkpoint, ignore_errors=True)
    try:
        training = train(
            model, log, job["scheme"], job["damping"], objective=job["objective"], test=test, seed=job["seed"],
            derivative=job["derivative"], checkpoint=job.checkpoint, resume=job["resume"] or False,
            force=job["force"],
            progress=job.say.progress,
        )  # fmt: skip
    except KeyboardInterrupt as end:
        if job.checkpoint.is_dir():
            raise type(end)(f"go on by the same command with out={job.out} resume=true") from None
        raise
    training.model.save(job.folder / "model")
    training.write(job.folder)
    data = training.to_dict()
    job.say(f"assumed   {data['derivative']['held_out']}")
    job.warn([warning for warning in data["warnings"] if warning not in model.vehicle.warnings])
    job.say(f"trained   {data['metrics']['iterations']} iterations: {data['stopped']}")
    for when in ("before", "after"):
        scores = {name: data["metrics"][f"held_out_r2_{name}_{when}"] for name in _ACCELERATIONS}
        shown = ", ".join(f"{n} {'unknown' if v is None else format(v, '.3f')}" for n, v in scores.items())
        job.say(f"result    held-out one-step R2 {when}: {shown}")
    free = [data["metrics"].get(f"held_out_rollout_5_s_total_{when}") for when in ("one_step", "after")]
    if None not in free:
        job.say(f"result    held-out free running over 5 s: {free[0]:.4g} one step, {free[1]:.4g} rollout")
    return training


_ACCELERATIONS = ("du", "dv", "dw", "dp", "dq", "dr")

VERB = Verb(
    summary="train the damping subnetworks on a log",
    reads=("log", "mapping", "model", "test"),
    writes=("training.json", "model/", "report.html", "figures/"),
    run=_run,
)
