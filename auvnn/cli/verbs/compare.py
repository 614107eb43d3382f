"""`auvnn compare`: a model against measurements."""

from __future__ import annotations

from auvnn.cli.results import horizons
from auvnn.cli.runs.dry import foreseen
from auvnn.cli.runs.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.comparison import compare
    from auvnn.comparison.beside import words

    log = job.log()
    comparison = compare(job.model(log), log, horizons=job["horizons"], derivative=job["derivative"])
    comparison.write(job.folder)
    data = comparison.to_dict()
    job.say(f"assumed   accelerations: {data['derivative']['method']}")
    job.warn(data["warnings"])
    for line in words(comparison.baseline):
        job.say(f"baseline  {line}")
    for line in horizons(data["rollout"]):
        job.say(f"result    {line}")
    for failure in data["failures"][:3]:
        share = f"{100 * failure['share']:.0f} % of the error"
        job.say(f"where     {failure['channel']}: {failure['where']} ({share})")
    return comparison


VERB = Verb(
    summary="a model against measurements: how far off, and where",
    reads=("log", "mapping", "model"),
    writes=("comparison.json", "predictions.parquet", "report.html", "figures/"),
    run=_run,
    foresee=foreseen,
)
