"""`auvnn compare`: a model, or several, against measurements."""

from __future__ import annotations

from functools import partial
from typing import Any

from auvnn.cli.results import horizons
from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.comparison import compare

    log = job.log(partial=True)
    models = job.models(log)
    options: dict[str, Any] = {"horizons": job["horizons"], "derivative": job["derivative"]}
    if len(models) == 1 and not isinstance(job["model"], list):
        comparison = compare(next(iter(models.values())), log, **options)
        comparison.write(job.folder)
        _say(job, comparison)
        return comparison
    several = compare(models, log, **options)
    several.write(job.folder)
    for label in several.models:
        job.say(f"model     {label}")
        _say(job, several[label], warn=False)
    job.warn(several.warnings)
    if several.horizon is not None:
        errors = [
            f"{label} {several[label].rollout[several.horizon]['total']:.3g}" for label in several.ranking
        ]
        job.say(f"ranking   error over {several.horizon} s of free running: {', '.join(errors)}")
    return several


def _say(job: Job, comparison: Any, warn: bool = True) -> None:
    """Say of one model what its report says first, then the numbers."""
    from auvnn.comparison.baseline import standing, words

    data = comparison.to_dict()
    job.say(f"assumed   accelerations: {data['derivative']['method']}")
    if warn:
        job.warn(data["warnings"])
    first, *others = standing(data["rollout"], comparison.baseline)
    worse = any(line.startswith("WORSE") for line in others)
    job.say(f"verdict   {'; '.join([first, *others])}", style="bold red" if worse else "bold")
    for line in words(comparison.baseline)[1:]:
        job.say(f"baseline  {line}")
    for line in horizons(data["rollout"]):
        job.say(f"result    {line}")
    for failure in data["failures"][:3]:
        share = f"{100 * failure['share']:.0f} % of the error"
        job.say(f"where     {failure['channel']}: {failure['where']} ({share})")


VERB = Verb(
    summary="a model, or several, against measurements: how far off, and where",
    reads=("log", "mapping", "model"),
    writes=("comparison.json", "predictions.parquet", "report.html", "figures/"),
    run=_run,
    dry_run=partial(check_inputs, several=True),
)
