"""`auvnn.import_model`: a simulator's vehicle file as a model file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from auvnn.answers import Answer
from auvnn.catalogue import Catalogue
from auvnn.config import write_yaml
from auvnn.errors import InputError
from auvnn.imports.tree import Reader, read_tree
from auvnn.models import GreyBox, from_vehicle
from auvnn.vehicle import Vehicle

SOURCES = Catalogue(
    "vehicle file",
    {
        "gz": "auvnn.imports.gz:GzSource",
        "uuv": "auvnn.imports.uuv:UuvSource",
    },
    "auvnn.imports",
)


@dataclass(frozen=True, repr=False)
class Imported(Answer):
    """A vehicle that was read from another simulator's file.

    Attributes:
        vehicle: its numbers.
        source: which kind of file it was.
        file: its name.
        unread: in words, what stood there and is not in the vehicle.
    """

    kind: ClassVar[str] = "import"
    vehicle: Vehicle
    source: str
    file: str
    unread: tuple[str, ...]

    @property
    def model(self) -> GreyBox:
        """The model of the vehicle."""
        return from_vehicle(self.vehicle)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        return {
            "schema": "auvnn/import/1", "file": self.file, "source": self.source, "name": self.vehicle.name,
            "unread": list(self.unread), "assumed": list(self.vehicle.warnings),
        }  # fmt: skip

    def save(self, path: str | Path) -> Path:
        """Write the model file, YAML."""
        return write_yaml(path, self.vehicle.to_dict())


def import_model(file: str | Path) -> Imported:
    """Read the vehicle of a gz-sim SDF file, or of a UUV Simulator URDF or SDF file, and say what could not be read.

    No expression of the file is evaluated: xacro files are to be expanded first.

    Args:
        file: the file.

    Raises:
        InputError: it is no such file, or what a vehicle cannot do without is not in it.
        ModelError: the vehicle in it is not physical.
    """
    path = Path(file).expanduser()
    root = read_tree(path)
    for name in SOURCES.names():
        source = SOURCES.get(name)()
        if source.knows(root):
            reader = Reader(str(path))
            data = source.read(root, reader)
            vehicle = Vehicle.from_dict(data, str(path))
            return Imported(vehicle, name, path.name, tuple(dict.fromkeys(reader.unread)))
    raise InputError(
        f"{path}: holds neither gz-sim's Hydrodynamics system nor UUV Simulator's underwater object: give the file "
        "that states the hydrodynamics"
    )
