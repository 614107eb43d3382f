"""Models written to disk: a folder with the model file, the weights and a manifest; `loading` reads it back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from auvnn.config import dump_yaml
from auvnn.storage import tensors_to_bytes, write_folder

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox

MODEL, WEIGHTS = "model.yaml", "weights.safetensors"
SUBNETWORKS = "damping_subnetworks"
STRUCTURE = "structure"
UNCERTAINTY = "uncertainty"
COVARIANCE = "covariance"
COMMANDS = "commands"
REGION = "trained_region"
PASSIVE = "passive_drag"

_readers: list[Callable[[Mapping[str, bytes], Path], object]] = []


def reads_again(reader: Callable[[Mapping[str, bytes], Path], object]) -> None:
    """Take the function that reads a model's files: `loading`, which stands above, says which one it is."""
    _readers[:] = [reader]


def read_again(files: Mapping[str, bytes], path: Path) -> None:
    """Read a model's files before they take the place of others, and raise where they cannot be read."""
    for reader in _readers:
        reader(files, path)


def save(model: GreyBox, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Write a model as a folder: `model.yaml`, the weights and a manifest with SHA-256 of each.

    The folder is staged beside its place and moved there, so that a kill leaves the old one intact.

    Args:
        model: that is written.
        folder: where to.
        overwrite: replace a model that is there.

    Raises:
        InputError: the folder exists, is not empty and `overwrite` is not set.
    """
    path = Path(folder)
    write_folder(
        path, contents(model, path), overwrite=overwrite, readable=lambda files: read_again(files, path)
    )
    return path


def contents(model: GreyBox, path: Path) -> dict[str, bytes | str]:
    """Return the files that describe a model, by name, as they are written into the folder `path`."""
    data = model.vehicle.to_dict()
    data.pop("effects", None)  # the file's order must not depend on where the effects came from
    data["effects"] = {
        str(e.name): {**e.values(), **({UNCERTAINTY: dict(e.uncertainty)} if e.uncertainty else {})}
        for e in model.copied_effects()
    }
    if model.joint is not None:
        data[COVARIANCE] = model.joint.to_dict()
    if model.commands is not None:
        data[COMMANDS] = model.commands.to_dict()
    data["actuation"] = model.actuation
    files: dict[str, bytes | str] = {}
    described, learned = model.learned_parts()
    data |= described
    if learned is not None:
        # Always in double precision, which holds single precision exactly: a folder has one form.
        files[WEIGHTS] = tensors_to_bytes({k: v.double() for k, v in learned.items()})
    files[MODEL] = dump_yaml(data, str(path))
    return files
