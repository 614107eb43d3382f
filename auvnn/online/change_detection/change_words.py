"""What kind of change was seen, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from auvnn.answer_types import ChangeEntry, ChangeKind, Parameters, ParameterValue


@dataclass
class Change:
    """A change of the vehicle.

    Attributes:
        time: s, when it happened, to about half a second.
        detected: s, when it was first certain that something had changed.
        kind: `drag`, `mass`, `buoyancy`, `actuator`, `force`, or `unclear`.
        effect: the one of the kind that says it best, or None.
        parameters: of that effect, name to value, std and unit; those that the data determines.
        evidence: logarithm of the odds against no change.
        explained: share of the residual since the change that the kind explains.
        kinds: for each kind, evidence and the share that it explains, the best first.
        words: one sentence.
    """

    time: float
    detected: float
    kind: str
    effect: str | None
    parameters: Parameters
    evidence: float
    explained: float
    kinds: list[ChangeKind]
    words: str

    def to_dict(self) -> dict[str, Any]:
        """Return the change as plain data."""
        return dict(vars(self))

    def entry(self, run: int) -> ChangeEntry:
        """Return the change as it stands in the answer, with the run in which it was seen."""
        return cast(ChangeEntry, {"run": run, **self.to_dict()})


def _words(
    named: str, kind: str, rivals: list[str], effect: str, parameters: Parameters,
    time: float, share: float,
) -> str:  # fmt: skip
    when = f"at {time:.1f} s"
    if named != "unclear":
        values = ", ".join(_value(name, v) for name, v in list(parameters.items())[:3])
        return f"{when} a change of {named} ({effect}: {values or 'no single value is determined'})"
    if rivals:
        others = " or ".join([kind, *rivals])
        return f"{when} something changed; with this excitation it cannot be told whether it was {others}"
    return (
        f"{when} something changed that no single kind explains: {kind} explains {100 * share:.0f} % at best"
    )


def _value(name: str, told: ParameterValue) -> str:
    unit = "" if told["unit"] == "1" else f" {told['unit']}"
    return f"{name} {told['value']:.3g} +- {told['std']:.2g}{unit}"
