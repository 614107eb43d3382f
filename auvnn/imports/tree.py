"""XML that may come from a stranger: sizes limited, no entities, numbers that are numbers, nothing evaluated."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np

from auvnn.answers import read_start
from auvnn.errors import InputError, one_line

MOST_BYTES = 5_000_000
MOST_ELEMENTS = 50_000
NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")


def read_tree(path: Path) -> xml.Element:
    """Return the root of an XML file.

    Raises:
        InputError: it cannot be read, is no XML, is too large, or declares entities.
    """
    raw = read_start(path, MOST_BYTES + 1, "is a folder, not an SDF or URDF file; name the file in it")
    if len(raw) > MOST_BYTES:
        raise InputError(f"{path}: is larger than {MOST_BYTES} bytes: give the vehicle's own file")
    if b"<!DOCTYPE" in raw or b"<!ENTITY" in raw:
        raise InputError(f"{path}: declares a document type or entities, which is refused: take them out")
    try:
        root = xml.fromstring(raw)
    except (xml.ParseError, ValueError, LookupError, RecursionError) as problem:
        raise InputError(f"{path}: is not XML ({one_line(problem, 200)})") from None
    if sum(1 for _ in root.iter()) > MOST_ELEMENTS:
        raise InputError(f"{path}: has more than {MOST_ELEMENTS} elements: give the vehicle's own file")
    return root


class Reader:
    """Takes numbers out of elements, and keeps what could not be read.

    Attributes:
        unread: in words, what was there and could not be used.
    """

    def __init__(self, where: str) -> None:
        """Start with everything readable."""
        self.where = where
        self.unread: list[str] = []

    def numbers(
        self, parent: xml.Element | None, path: str, count: tuple[int, ...], default: object = None
    ) -> np.ndarray:
        """Return the numbers of an element's text, or the default where the element is not there.

        Args:
            parent: element below which it is looked for; None where that is not there.
            path: of the element, as `ElementTree.find` takes it.
            count: how many numbers are allowed.
            default: where the element is not there; it must be there where this is None.

        Raises:
            InputError: it is needed and not there, holds an expression, or another count of numbers.
        """
        element = None if parent is None else parent.find(path)
        if element is None:
            if default is None:
                raise InputError(f"{self.where}: there is no <{path.split('/')[-1]}>, which is needed")
            return np.asarray(default, dtype=float)
        return self.parsed(element.text or "", path, count)

    def parsed(self, text: str, what: str, count: tuple[int, ...]) -> np.ndarray:
        """Return the numbers of a text.

        Args:
            text: numbers apart by spaces or commas.
            what: where it stands, for messages.
            count: how many numbers are allowed.
        """
        if "$" in text:
            raise InputError(
                f"{self.where}: {what} is the expression '{one_line(text, 60)}', and none is evaluated here: "
                "expand the file first (xacro FILE > vehicle.urdf)"
            )
        words = text.replace(",", " ").split()
        wrong = next((w for w in words if not NUMBER.fullmatch(w)), None)
        if wrong is not None or len(words) not in count:
            shown = f"holds '{one_line(wrong, 40)}'" if wrong is not None else f"has {len(words)} numbers"
            raise InputError(
                f"{self.where}: {what} {shown}: {' or '.join(map(str, count))} numbers are needed"
            )
        values = np.array([float(w) for w in words])
        if not all(math.isfinite(v) and abs(v) < 1e17 for v in values):
            raise InputError(f"{self.where}: {what} is beyond any vehicle")
        return values

    def number(self, parent: xml.Element | None, path: str, default: float | None = None) -> float:
        """Return one number.

        Args:
            parent: element below which it is looked for; None where that is not there.
            path: of the element, as `ElementTree.find` takes it.
            default: where the element is not there; it must be there where this is None.
        """
        return float(self.numbers(parent, path, (1,), None if default is None else [default])[0])

    def attribute(self, element: xml.Element, name: str, count: int, default: object) -> np.ndarray:
        """Return the numbers of an attribute.

        Args:
            element: that has it.
            name: of the attribute.
            count: how many numbers it must hold.
            default: where the attribute is not there.
        """
        text = element.get(name)
        return np.asarray(default, dtype=float) if text is None else self.parsed(text, name, (count,))


def turned(angles: np.ndarray) -> np.ndarray:
    """Return the rotation of roll, pitch and yaw, (3, 3), as SDF and URDF mean them: about fixed axes."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip
