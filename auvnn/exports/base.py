"""What an export target is: a name, and how it writes a system into a folder."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from auvnn.exports.system import System


@dataclass
class Written:
    """What a target wrote.

    Attributes:
        lost: what of the model is not in it, in words, one sentence each.
        notes: what is good to know of it, in words.
        agreement: largest difference from the model at random states, relative to the largest element of the same
            answer, by function; empty where the target has no function to ask.
    """

    lost: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    agreement: dict[str, float] = field(default_factory=dict)


class Target(ABC):
    """A form in which a model leaves.

    Attributes:
        name: in the catalogue.
        summary: one line for a listing.
        precisions: number formats that it can be written in, the default first.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    precisions: ClassVar[tuple[str, ...]] = ("double",)

    @abstractmethod
    def write(self, system: System, folder: Path, precision: str) -> Written:
        """Write the system's files into a folder that exists.

        Args:
            system: the model as first-order equations.
            folder: that exists.
            precision: "double" or "float".

        Raises:
            AuvnnError: it cannot be written at all.
        """
