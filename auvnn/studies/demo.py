"""The whole way on a built-in vehicle with a hidden ocean current: compare, see, name, add, watch the error fall."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from auvnn.answers import DRAWERS, Answer, plain, write_text
from auvnn.comparison import Comparison, compare
from auvnn.diagnosis import Diagnosis, diagnose
from auvnn.diagnosis.answers.words import number
from auvnn.improvement import Improvement, add
from auvnn.logs import Log
from auvnn.metrics.rollouts import rollout_table, scale_of
from auvnn.models import GreyBox, load
from auvnn.simulation import simulate
from auvnn.simulation.simulate import Simulation

VEHICLE = "rov95"
HIDDEN = {"ocean_current": {"v_north": 0.15, "v_east": -0.10, "v_down": 0.0}}
RUNS, DURATION = 4, 60.0


@dataclass(repr=False)
class Demo(Answer):
    """The demo's four answers and its story."""

    kind = "demo"
    truth: dict[str, Any]
    quality: Any
    comparison: Comparison
    diagnosis: Diagnosis
    improvement: Improvement
    true_error: float
    seconds: float
    story: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return what was hidden, what was found, and the error on the way."""
        found = {
            c["effect"]: c["parameters"]
            for c in self.diagnosis.candidates
            if c["effect"] in self.diagnosis.missing
        }
        errors = {step["step"]: step["error"] for step in self.improvement.waterfall}
        return plain(
            {
                "schema": "auvnn/demo/1",
                "hidden": self.truth["hidden"],
                "verdict": self.diagnosis.verdict,
                "missing": self.diagnosis.missing,
                "parameters": found,
                "story": self.story,
                "metrics": {
                    "error_as_given": errors.get("as given"),
                    "error_after": self.improvement.waterfall[-2]["error"],
                    "error_true_model": self.true_error,
                    "error_noise_floor": errors.get("noise floor"),
                    "seconds": self.seconds,
                },
            }
        )


def made_logs(model: GreyBox, seed: int = 0) -> tuple[Simulation, Log, Log]:
    """Return the demo's simulation with its hidden current, the log to fit on, and the held-out last run."""
    made = simulate(model, "multisine", "realistic", HIDDEN, seed, runs=RUNS, duration=DURATION)
    numbers = [run.number for run in made.log.runs]
    return made, made.log.select(numbers[:-1]), made.log.select(numbers[-1:])


def run_demo(out: Path, seed: int = 0, say: Callable[[str], None] = print) -> Demo:
    """Hide a current, and go the whole way.

    Args:
        out: folder; gets one subfolder per verb and `report.html`.
        seed: of manoeuvre and noise.
        say: called with each line of the story.
    """
    import time

    began = time.monotonic()
    out = Path(out)
    model = load(VEHICLE)
    made, log, test = made_logs(model, seed)
    log.write(out / "simulate" / "log.parquet")
    test.write(out / "simulate" / "test.parquet")
    write_text(out / "simulate" / "truth.json", json.dumps(plain(made.truth), indent=1, allow_nan=False))
    lines: list[str] = []

    def tell(line: str) -> None:
        lines.append(line)
        say(line)

    tell(
        f"made      {RUNS} runs of {DURATION:g} s of {VEHICLE} in a current that its model does not know; realistic "
        "noise, no accelerations; the last run is held out"
    )
    quality = log.quality()
    quality.write(out / "check")
    tell(
        f"check     {log.samples} samples at {1 / log.runs[0].dt:.3g} Hz; "
        f"{len(quality.to_dict()['findings'])} findings (check/report.html)"
    )
    comparison = compare(model, test)
    comparison.write(out / "compare")
    five = comparison.rollout["5"]
    tell(
        f"compare   free running for 5 s is off by {five['total']:.2f} standard deviations of the motion "
        f"(holding the speed: {five['persistence']:.2f})"
    )
    if comparison.failures:
        worst = comparison.failures[0]
        tell(f"where     most of it in {worst['where']} ({worst['share']:.0%} of the residual)")
    diagnosis = diagnose(model, log)
    diagnosis.write(out / "diagnose")
    for line in diagnosis.story:
        tell(f"diagnose  {line}")
    improvement = add(model, log, diagnosis.missing or ["ocean_current"], test=test)
    improvement.write(out / "add")
    improvement.model.save(out / "add" / "model")
    scale = scale_of(test)
    true_error = rollout_table(made.plant, test, scale, ("5",))[0]["5"]["total"]
    falls = {step["step"]: step["error"] for step in improvement.waterfall}
    refitted, after = falls["coefficients refitted"], improvement.waterfall[-2]["error"]
    tell(
        f"add       held-out error: {falls['as given']:.3f} as given, {refitted:.3f} with its coefficients refitted, "
        f"{after:.3f} with {', '.join(improvement.effects)}"
    )
    tell(
        f"floor     {true_error:.3f} is what the true model gives on the same data; noise alone leaves "
        f"{falls['noise floor']:.3f}; the gain of {number(improvement.gain['value'], improvement.gain['std'], '1')} is "
        f"{'accepted' if improvement.accepted else 'not accepted'}"
    )
    hidden = made.truth["hidden"]["ocean_current"]
    tell("truth     hidden was: " + ", ".join(f"{k} {v:g} m/s" for k, v in hidden.items()))
    answer = Demo(
        made.truth, quality, comparison, diagnosis, improvement, true_error, time.monotonic() - began, lines
    )
    DRAWERS.get("demo").write(answer, out)
    say(f"report    {out / 'report.html'}")
    return answer
