"""`auvnn add`: add effects, refit, and compare before and after on held-out data."""

from __future__ import annotations

from auvnn.cards import not_needed, still_beaten
from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.comparison.baseline import words
    from auvnn.diagnosis.answers.words import parameters
    from auvnn.improvement import add

    effects, log, test = job.names("effect"), job.log(partial=True), job.held_out(partial=True)
    model, say = job.model(log), job.say
    better = add(
        model, log, effects,
        test=test, derivative=job["derivative"], window=job["window"], objective=job["objective"]["objective"],
        force=job["force"], refit=job["refit"], progress=say.progress,
    )  # fmt: skip
    better.model.save(job.folder / "model")
    better.write(job.folder)
    data = better.to_dict()
    said = "assumed" if test is None else "test"
    say(f"{said:<9} {data['held_out']}")
    job.warn(data["warnings"])
    for line in words(better.baseline):
        say(f"baseline  {line}")
    for name, values in data["parameters"].items():
        say(f"fitted    {name}: {parameters(values)}")
    for step in data["waterfall"]:
        error = "unknown" if step["error"] is None else f"{step['error']:.4g}"
        say(f"error     {step['step']}: {error}")
    gain = f"{data['gain']['value']:.4g} +- {data['gain']['std']:.2g}" if data["gain"]["std"] else "unknown"
    why = not_needed(data["gain"], data["by_effect"]) or "the held-out error does not fall enough"
    verdict = "accepted" if data["accepted"] else f"not accepted: {why}"
    minded = [w for entry in data["by_effect"].values() for w in entry["reservations"]]
    minded += [beaten] if (beaten := still_beaten(better.baseline)) else []
    if data["accepted"] and minded:
        verdict = f"accepted, but mind: {'; '.join(dict.fromkeys(minded))}"
    for name, entry in data["by_effect"].items() if len(data["by_effect"]) > 1 else ():
        own, pays = (
            entry["gain"],
            "improves the prediction" if entry["accepted"] else "does not improve the prediction",
        )
        fall = f"{own['value']:.4g} +- {own['std']:.2g}" if own["std"] else "unknown"
        say(f"effect    {name} {pays} in addition to the others (fall of the held-out error: {fall})")
    say(f"result    {verdict} (fall from the refitted model: {gain})", style="bold")
    return better


VERB = Verb(
    summary="add effects, refit, and compare before and after on held-out data",
    reads=("log", "mapping", "model", "test"),
    writes=("improvement.json", "model/", "report.html", "figures/"),
    run=_run,
    dry_run=check_inputs,
)
