"""`auvnn train`: train the damping subnetworks on a log."""

from __future__ import annotations

import shutil

from auvnn.cli.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.training import train

    log, test = job.log(), job.held_out()
    if job["overwrite"] and not job["resume"]:
        shutil.rmtree(job.checkpoint, ignore_errors=True)
    try:
        training = train(
            job.model(log), log, job["scheme"], job["damping"], test=test, seed=job["seed"],
            checkpoint=job.checkpoint, resume=job["resume"] or False, progress=job.say.progress,
        )  # fmt: skip
    except KeyboardInterrupt as end:
        if job.checkpoint.is_dir():
            raise type(end)(f"go on by the same command with out={job.out} resume=true") from None
        raise
    training.model.save(job.folder / "model")
    training.write(job.folder)
    for name, value in training.to_dict()["metrics"].items():
        job.say(f"result    {name} {value:.4g}" if isinstance(value, float) else f"result    {name} {value}")
    return training


VERB = Verb(
    summary="train the damping subnetworks on a log",
    reads=("log", "mapping", "model", "test"),
    writes=("model/", "training.json", "report.html", "figures/"),
    run=_run,
)
