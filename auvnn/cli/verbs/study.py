"""`auvnn study`: a case study of the paper."""

from __future__ import annotations

from auvnn.cli.runs.job import Answering, Job, Verb

TAKEN = ("case", "model", "seed", "rate", "duration", "step", "manoeuvre", "damping", "scheme", "effort")


def _run(job: Job) -> Answering:
    from auvnn.studies.paper import run_study

    study = run_study({key: job[key] for key in TAKEN}, progress=job.say.progress)
    study.model.save(job.folder / "model")
    study.write(job.folder, report=bool(job["report"]))
    data = study.to_dict()
    for words in data["assumed"]:
        job.say(f"assumed   {words}")
    job.warn(data["warnings"])
    for name, value in data["metrics"].items():
        if name.endswith(("worst", "over_offline")) or "_over_six_" in name or "over_best" in name:
            job.say(f"result    {name} {'unknown' if value is None else format(value, '.4g')}")
    return study


VERB = Verb(
    summary="a case study of the paper: noise-free, noisy, or a payload picked up",
    reads=("model",),
    writes=("study.json", "model/", "report.html", "figures/"),
    run=_run,
)
