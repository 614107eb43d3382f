"""`auvnn.export`: a model written for another program, with what is lost on the way said in words."""

from __future__ import annotations

import math
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from auvnn.answers import Answer, plain
from auvnn.errors import ConfigError, InputError
from auvnn.exports.base import Target
from auvnn.exports.system import System
from auvnn.exports.targets import TARGETS
from auvnn.models import GreyBox, load

DISAGREES = {"double": 1e-9, "float": 1e-3}
"""Difference from the model beyond which what was written is not handed over."""


@dataclass(frozen=True, repr=False)
class Export(Answer):
    """What an export wrote.

    Attributes:
        model: name of the vehicle.
        to: target.
        precision: of numbers.
        dt: step, s, at which a delay is exact.
        files: names in the folder.
        lost: what of the model is not in them, one sentence each.
        notes: what is good to know.
        states: names of the state in continuous time.
        step_states: names of the state in steps.
        inputs: names of the inputs.
        agreement: largest difference from the model at random states, relative, by function.
        folder: where they are.
    """

    kind: ClassVar[str] = "export"
    model: str
    to: str
    precision: str
    dt: float
    files: tuple[str, ...]
    lost: tuple[str, ...]
    notes: tuple[str, ...]
    states: tuple[str, ...]
    step_states: tuple[str, ...]
    inputs: tuple[str, ...]
    agreement: dict[str, float]
    folder: Path

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = (
            "model",
            "to",
            "precision",
            "dt",
            "files",
            "lost",
            "notes",
            "states",
            "step_states",
            "inputs",
        )
        return {
            "schema": "auvnn/export/1",
            **{name: plain(getattr(self, name)) for name in names},
            "agreement": plain(self.agreement),
        }


def export(
    model: GreyBox | str | Path,
    to: str,
    out: str | Path,
    *,
    strict: bool = False,
    precision: str | None = None,
    dt: float = 0.05,
    name: str | None = None,
    overwrite: bool = False,
) -> Export:
    """Write a model for another program.

    Args:
        model: the model, or what `load` takes.
        to: "c", "casadi", "fmu", "onnx", "torch" or "sdf".
        out: folder for the files and `export.json`; new or empty.
        strict: refuse where anything is lost.
        precision: "double" or "float"; by default the first that the target has.
        dt: step, s, of the functions that step; with a delay they take this step alone.
        name: of functions and files; by default the vehicle's.
        overwrite: replace files of the same names.

    Returns:
        What was written, and what is lost.

    Raises:
        ConfigError: an unknown target or precision, a model that cannot be written, or with `strict` a loss.
        InputError: the folder is not empty.
        MissingExtra: the target needs a package that is not there.

    Example:
        ```python
        answer = auvnn.export(auvnn.load("rov95"), to="sdf", out="simulated", overwrite=True)
        answer.files, answer.lost
        ```
    """
    target = TARGETS.get(to)()
    assert isinstance(target, Target)
    precision = precision or target.precisions[0]
    if precision not in target.precisions:
        raise ConfigError(f"precision={precision}: to={to} knows {', '.join(target.precisions)}")
    if not (math.isfinite(dt) and dt > 0):
        raise ConfigError(f"dt={dt}: give a positive step in s")
    known = model if isinstance(model, GreyBox) else load(model)
    vehicle = known.vehicle
    if vehicle.glides or (vehicle.reduced and to == "sdf"):
        raise ConfigError(
            f"{vehicle.name} is a reduced model, which to={to} has no place for: state all its degrees"
        )
    path = Path(out).expanduser()
    if path.exists() and (not path.is_dir() or any(path.iterdir())) and not overwrite:
        raise InputError(f"{path}: is not an empty folder: choose another, or say overwrite=true")
    system = System(known, dt, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    staged = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}.", suffix=".partial"))
    try:
        written = target.write(system, staged, precision)
        for function, error in written.agreement.items():
            if not error <= DISAGREES[precision]:
                raise ConfigError(
                    f"to={to}: {function} differs from the model by {error:.2g}: nothing was written"
                )
        if strict and written.lost:
            more = f" (and {len(written.lost) - 1} more)" if len(written.lost) > 1 else ""
            raise ConfigError(
                f"strict=true and to={to} loses something: {written.lost[0]}{more}; use another target"
            )
        files = sorted(str(f.relative_to(staged)) for f in staged.rglob("*") if f.is_file())
        answer = Export(
            system.model.vehicle.name, to, precision, dt, tuple(files), tuple(written.lost), tuple(written.notes),
            tuple(system.flow.state_names()), tuple(system.steps.state_names()), tuple(system.flow.input_names()),
            written.agreement, path,
        )  # fmt: skip
        answer.write(staged, report=False)
        _move(staged, path)
    finally:
        shutil.rmtree(staged, ignore_errors=True)
    return answer


def _move(staged: Path, path: Path) -> None:
    """Move all files into place; mkdtemp makes private folders, and these are to be read."""
    staged.chmod(0o755)
    if not path.exists():
        os.replace(staged, path)
        return
    for file in sorted(f for f in staged.rglob("*") if f.is_file()):
        place = path / file.relative_to(staged)
        place.parent.mkdir(parents=True, exist_ok=True)
        os.replace(file, place)
