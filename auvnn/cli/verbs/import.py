"""`auvnn import`: a vehicle file of another simulator as a model file."""

from __future__ import annotations

from auvnn.cli.runs.job import Answering, Job, Verb, files


def _run(job: Job) -> Answering:
    from auvnn.imports import import_model

    answer = import_model(files(job.options, "file")[0])
    answer.save(job.folder / "model.yaml")
    answer.write(job.folder, report=False)
    parts = f"{answer.vehicle.n_thrusters} thrusters, {answer.vehicle.n_fins} fins"
    job.say(
        f"result    {answer.vehicle.name}, {answer.vehicle.mass:g} kg, {parts} (a file of {answer.source})"
    )
    for word in answer.unread:
        job.say(f"unread    {word}", style="yellow")
    for word in answer.vehicle.warnings:
        job.say(f"assumed   {word}", style="yellow")
    return answer


VERB = Verb(
    summary="a vehicle of gz-sim or UUV Simulator as a model file",
    reads=("file",),
    writes=("model.yaml", "import.json"),
    run=_run,
)
