"""One log of a benchmark as data: what is hidden, in what, how it is driven and measured."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

NOTHING = "nothing"
JOIN = "+"
# Manoeuvres under a controller that sees what the sensors report.
CLOSED = ("survey", "reciprocal", "dives")
LOOPS = ("open", "closed")
KINDS = ("effect", "several", "stranger", "nothing")
# Between the seeds of different effects.
APART = 100_000


@dataclass(frozen=True)
class Case:
    """One log of the benchmark.

    Attributes:
        vehicle: built-in name.
        hidden: effect, several joined by "+", a stranger to the catalogue, or "nothing".
        size: small, medium or large, one for each of several effects joined by "+", or what it costs of the 5 s error,
            such as "40%"; "none" with nothing hidden.
        noise: condition.
        excitation: manoeuvre.
        coefficients: "exact" or "drawn".
        seed: of everything.
        runs: of the log that is diagnosed.
        duration: of each run, s.
        rate: samples per second.
        plant: what moves: "own", the package's equations, or the name of an independent implementation.
        accelerations: whether they are logged; None as the noise condition says.
        held_out: further runs of the same plant, on which the models are compared; none if 0.
        ties: whether it is worked out which other effects could pass for the hidden one on this log.
        candidates: names that the diagnosis may give; None for the whole catalogue.
        kind: "effect", "several", "stranger" or "nothing".
        part: of a plan.
        world: what departs from the model's assumptions; the usual one if empty.
        oracle: whether it is worked out what an oracle sees that knows the world's law.
        without: channels for which the vehicle has no sensor.
    """

    vehicle: str
    hidden: str
    size: str
    noise: str
    excitation: str
    coefficients: str
    seed: int
    runs: int
    duration: float
    rate: float
    plant: str = "own"
    accelerations: bool | None = None
    held_out: int = 0
    ties: bool = False
    candidates: tuple[str, ...] | None = None
    kind: str = "effect"
    part: str = ""
    world: str = ""
    oracle: bool = False
    without: tuple[str, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """What is hidden, one name each; empty with nothing."""
        return () if self.kind == "nothing" else tuple(self.hidden.split(JOIN))

    @property
    def sizes(self) -> tuple[str, ...]:
        """The size of each hidden effect."""
        return () if self.kind == "nothing" else tuple(self.size.split(JOIN))

    @property
    def loop(self) -> str:
        """Whether a controller closes the loop."""
        return "closed" if self.excitation in CLOSED else "open"

    def to_row(self) -> dict[str, Any]:
        """Return the case as the beginning of its row."""
        row = asdict(self)
        row["candidates"] = None if self.candidates is None else list(self.candidates)
        row["without"] = list(self.without)
        return {**row, "effects": list(self.effects), "loop": self.loop}

    @classmethod
    def of_row(cls, row: Mapping[str, Any]) -> Case:
        """Return the case that a row is about; a key that is not there has its default."""
        known = {f.name: row[f.name] for f in fields(cls) if f.name in row}
        if known.get("candidates") is not None:
            known["candidates"] = tuple(known["candidates"])
        known["without"] = tuple(known.get("without") or ())
        return cls(**known)


def apart(name: str) -> int:
    """Return how far an effect's seeds are from the others': logs that share their noise would err together.

    It follows from the name alone, so that no log changes with what else is asked for.
    """
    return APART * (1 + zlib.crc32(name.encode()) % 9973)
