"""`auvnn simulate`: a log from a model, with effects hidden in it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from auvnn.answers import plain, write_text
from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb


@dataclass(frozen=True)
class _Truth:
    data: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        return plain(self.data)


def _run(job: Job) -> Answering:
    from auvnn.logs.without_sensors import without
    from auvnn.logs.writing import write_commands
    from auvnn.simulation import simulate

    model = job.model()
    hidden = _sized(job, model, _named(job))
    made = simulate(
        model, job["excitation"], job["noise"], hidden, job["seed"],
        runs=job["runs"], duration=job["duration"], rate=job["rate"], coefficients=job["coefficients"],
        actuation=job["actuation"], accelerations=job["accelerations"], max_step=job["max_step"], bottom=job["bottom"],
        plant=job["plant"], world=job["world"],
    )  # fmt: skip
    without(made.log, job.names("without") if job["without"] else []).write(job.folder / "log.parquet")
    if job["commands"]:
        write_commands(made.log, job.folder / "commands.csv")
        job.say("result    commands.csv holds the commands of the vehicle, row by row")
    truth = _Truth(made.truth)
    write_text(job.folder / "truth.json", json.dumps(truth.to_dict(), indent=1, allow_nan=False))
    for name, values in made.truth["hidden"].items():
        job.say(f"hidden    {name}: " + ", ".join(f"{k} {v:.4g}" for k, v in values.items()))
    excitation, noise = (job[key]["name"] for key in ("excitation", "noise"))
    job.say(f"result    {len(made.log.runs)} runs, {made.log.samples} samples, {excitation}, noise {noise}")
    return truth


def _named(job: Job) -> dict[str, dict[str, float] | None]:
    hidden = job["hidden"]
    if hidden is None or hidden == []:
        return {}
    if isinstance(hidden, dict):
        return hidden
    return dict.fromkeys(job.names("hidden"))


def _sized(job: Job, model: Any, hidden: dict[str, Any]) -> dict[str, Any]:
    if job.options.get("size") is None:
        return hidden
    from auvnn.studies.hidden import sized

    size = job["size"]["name"]
    how = {k: job[k] for k in ("excitation", "noise", "seed", "runs", "duration", "rate")}
    return {name: values or sized(model, name, size, **how) for name, values in hidden.items()}


VERB = Verb(
    summary="a log from a model, with effects hidden in it, for practice and tests",
    reads=("model",),
    writes=("log.parquet", "truth.json"),
    run=_run,
    dry_run=check_inputs,
)
