"""`auvnn export`: a model written for another program."""

from __future__ import annotations

from auvnn.cli.runs.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.exports import export

    answer = export(
        job.model(), str(job["to"]), job.folder, strict=job["strict"], precision=job["precision"], dt=job["dt"],
        name=job["name"], overwrite=True,
    )  # fmt: skip
    job.say(f"result    {', '.join(answer.files)}")
    if answer.agreement:
        worst = max(answer.agreement.values())
        job.say(f"agrees    with the model to {worst:.1e} of the largest value, at random states")
    for word in answer.lost:
        job.say(f"lost      {word}", style="yellow")
    for word in answer.notes:
        job.say(f"note      {word}")
    return answer


VERB = Verb(
    summary="a model as C, CasADi, FMU, ONNX, torch.export or gz-sim SDF",
    reads=("model",),
    writes=("export.json",),
    run=_run,
)
