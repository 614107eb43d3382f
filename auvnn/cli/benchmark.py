"""`auvnn benchmark`: hide effects, diagnose, and count what was named."""

from __future__ import annotations

from auvnn.cli.job import Answering, Job, Verb

TAKEN = (
    "effects",
    "sizes",
    "noises",
    "excitations",
    "vehicles",
    "coefficients",
    "repeats",
    "seed",
    "runs",
    "duration",
    "rate",
    "workers",
)


def _run(job: Job) -> Answering:
    from auvnn.studies.benchmark import benchmark

    answer = benchmark({key: job[key] for key in TAKEN}, progress=job.say.progress)
    answer.write(job.folder)
    for row in answer.table:
        verdicts = ", ".join(f"{k} {v}" for k, v in row["answers"].items())
        job.say(
            f"{row['hidden']:<19} {row['size']:<7} {row['noise']:<10} {row['excitation']:<10} "
            f"{row['named_first']} of {row['logs']} named first; {verdicts}"
        )
    for name, value in answer.to_dict()["metrics"].items():
        shown = "unknown" if value is None else f"{value:.4g}" if isinstance(value, float) else value
        job.say(f"result    {name} {shown}")
    return answer


VERB = Verb(
    summary="the hidden-effect benchmark: how often the right name is found, how often a wrong one",
    reads=(),
    writes=("benchmark.json", "report.html", "figures/"),
    run=_run,
)
