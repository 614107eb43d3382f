"""`auvnn check`: what was read, repaired, implausible and excited in a log."""

from __future__ import annotations

from auvnn.cli.job import Answering, Job, Verb

_STYLE = {"error": "red", "warning": "yellow"}


def _run(job: Job) -> Answering:
    log = job.log(repairs=False)  # they are findings too
    quality = log.quality()
    if job["model"] is not None:
        from auvnn.checks import check_actuators

        checked = check_actuators(job.model(log), log)
        quality = quality.with_actuators(checked)
    quality.write(job.folder)
    findings = quality.to_dict()["findings"]
    for finding in findings:
        level = finding["level"]
        cure = f"; {finding['cure']}" if finding["cure"] else ""
        job.say(f"{level:<9} {finding['where']}: {finding['what']}{cure}", style=_STYLE.get(level))
    if not findings:
        job.say("result    nothing to complain of")
    if quality.actuators is not None:
        for line in quality.actuators["story"]:
            job.say(f"actuators {line}")
    return quality


VERB = Verb(
    summary="quality report of a log: what was read, repaired, implausible, excited",
    reads=("log", "mapping", "model"),
    writes=("quality.json", "report.html", "figures/"),
    run=_run,
)
