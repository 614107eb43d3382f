"""`auvnn adapt`: adapt the damping subnetworks over a log, sample by sample."""

from __future__ import annotations

from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.online import adapt
    from auvnn.report.pages.sections.adaptation_words import early_words, off_words, ratio_words, worse_words
    from auvnn.report.words import plural

    log = job.log()
    model = job.model(log)
    adaptation = adapt(
        model, log, job["learner"], guards=job["guards"], damping=job["damping"],
        state=job.folder / "state", progress=job.say.progress,
    )  # fmt: skip
    adaptation.model.save(job.folder / "model")
    adaptation.write(job.folder)
    data = adaptation.to_dict()
    for words in data["assumed"]:
        job.say(f"assumed   {words}")
    job.say(f"compared  {data['compared']}")
    job.warn(data["warnings"])
    metrics = data["metrics"]
    job.say(f"learned   from {metrics['samples_learned']} of {metrics['samples']} samples")
    for name, told in data["skipped"].items():
        job.say(f"skipped   {plural(told['count'], 'sample')} ({name}): {told['words']}")
    for change in data["changes"]:
        job.say(f"change    run {change['run']}: {change['words']}")
    for words in early_words(data["changes"], data["history"]):
        job.say(f"early     {words}", style="yellow")
    if not data["changes"]:
        job.say("change    none was seen")
        for words in off_words(metrics):
            job.say(f"off       {words}", style="yellow")
    ratio = metrics["frozen_5_s_error_ratio"]
    shown = "the error is unknown" if ratio is None or ratio != ratio else ratio_words(ratio)
    job.say(f"result    free running 5 s with weights frozen at each moment: {shown}")
    for words in worse_words(ratio):
        job.say(f"worse     {words}", style="yellow")
    return adaptation


VERB = Verb(
    summary="adapt the damping subnetworks over a log, sample by sample",
    reads=("log", "mapping", "model"),
    writes=("adaptation.json", "model/", "state/", "report.html", "figures/"),
    run=_run,
    dry_run=check_inputs,
)
