"""Checkpoints of a fit: whole or absent, checked when read, tied to the data and options they belong to."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from auvnn.errors import ConfigError, InputError, ModelError
from auvnn.storage import read_folder, tensors_from_bytes, tensors_to_bytes, write_folder
from auvnn.storage.removal import remove_own, remove_unfinished

SCHEMA = "auvnn/checkpoint/1"
KEPT = 2
_FILES = ("state.json", "state.safetensors")


class Checkpoints:
    """The checkpoints of one fit in one folder, of which the newest two are kept.

    Args:
        folder: made when the first checkpoint is written.
        identity: plain data that says what is being fitted, and how; a checkpoint made under another identity
            is refused.
    """

    def __init__(self, folder: str | Path, identity: Mapping[str, Any]) -> None:
        """Keep the place; nothing is read or written yet."""
        self.folder = Path(folder)
        self.identity = json.loads(json.dumps(dict(identity)))

    def _found(self) -> list[Path]:
        """Return the checkpoints, the newest first."""
        if not self.folder.is_dir():
            return []
        names = [path for path in self.folder.iterdir() if re.fullmatch(r"checkpoint-\d{8,}", path.name)]
        return sorted(names, key=lambda path: int(path.name.rpartition("-")[2]), reverse=True)

    def refuse_if_used(self) -> None:
        """Refuse to start again over the checkpoints of another fit.

        Raises:
            InputError: there are checkpoints.
        """
        if self._found():
            raise InputError(
                f"{self.folder}: holds the checkpoints of a fit: say resume=true, or choose another folder"
            )

    def save(self, iteration: int, tensors: Mapping[str, Tensor], plain: Mapping[str, Any]) -> Path:
        """Write a checkpoint beside its place, move it there, and drop all but the newest two.

        Args:
            iteration: number of it.
            tensors: of the state, by name.
            plain: what JSON can hold of it.
        """
        state = json.dumps({"identity": self.identity, "iteration": iteration, "state": plain})
        # A state may hold infinite costs of starts that failed; weights that are saved as a model may not.
        weights = tensors_to_bytes(tensors, finite=False)
        path = self.folder / f"checkpoint-{iteration:08d}"
        if path.exists():
            # A damaged one that was passed over, or one ahead of where a resumed fit went on from.
            remove_own(path, _FILES)
        files: dict[str, bytes | str] = {"state.json": state, "state.safetensors": weights}
        write_folder(path, files, schema=SCHEMA, readable=_parts)
        for old in self._found()[KEPT:]:
            with contextlib.suppress(InputError):  # what it also holds is not ours to delete
                remove_own(old, _FILES)
        return path

    def load(
        self, expected: Mapping[str, tuple[tuple[int, ...], torch.dtype]], *, force: bool = False
    ) -> tuple[int, dict[str, Tensor], dict[str, Any], list[str]] | None:
        """Return the newest checkpoint that is intact.

        Args:
            expected: name to (shape, dtype) of tensors that must be there; there may be more.
            force: take a checkpoint made under another identity.

        Returns:
            Iteration, tensors, plain data, and a sentence for each newer checkpoint that was damaged; None
            where there is no checkpoint at all.

        Raises:
            ModelError: there are checkpoints, but none is intact, or the tensors do not fit.
            ConfigError: data or options have changed since.
        """
        for leftover in self.folder.glob(".checkpoint-*.partial") if self.folder.is_dir() else ():
            remove_unfinished(leftover)  # of a run that was killed while it saved
        notes: list[str] = []
        for path in self._found():
            try:
                files = read_folder(path, schema=SCHEMA)
                state, tensors = _parts(files, path)
            except (ModelError, KeyError, ValueError) as error:
                notes.append(f"checkpoint not used: {error}")
                continue
            if not force:
                self._compare(path, state["identity"])
            self._check(path, tensors, expected)
            # Fresh allocations: the alignment of memory may decide the last bit of a sum.
            tensors = {name: tensor.clone() for name, tensor in tensors.items()}
            return state["iteration"], tensors, state["state"], notes
        if notes:
            raise ModelError(f"{self.folder}: no checkpoint is intact ({'; '.join(notes)}): train again")
        return None

    def _compare(self, path: Path, identity: Mapping[str, Any]) -> None:
        changes = _changes(identity, self.identity)
        if changes:
            raise ConfigError(
                f"{path}: belongs to another fit ({'; '.join(changes)}): "
                "choose another folder, or say resume=force"
            )

    def _check(
        self,
        path: Path,
        tensors: Mapping[str, Tensor],
        expected: Mapping[str, tuple[tuple[int, ...], torch.dtype]],
    ) -> None:
        wrong = [f"{name} is missing" for name in expected if name not in tensors]
        for name, (shape, dtype) in expected.items():
            if name in tensors and (tuple(tensors[name].shape), tensors[name].dtype) != (tuple(shape), dtype):
                found = f"{tuple(tensors[name].shape)} {tensors[name].dtype}"
                wrong.append(f"{name} is {found} instead of {tuple(shape)} {dtype}")
        if wrong:
            raise ModelError(
                f"{path}: does not fit this fit: {'; '.join(wrong)}: train again in another folder"
            )


def _parts(
    files: Mapping[str, bytes], path: Path | str = "checkpoint"
) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return what a checkpoint's files hold: the plain part, and the tensors."""
    try:
        state = json.loads(files["state.json"])
        whole = isinstance(state["identity"], dict) and isinstance(state["state"], dict)
        state["iteration"] = int(state["iteration"])
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise ModelError(f"{path}: state.json cannot be read ({type(error).__name__})") from None
    if not whole:
        raise ModelError(f"{path}: state.json is not that of a checkpoint")
    where = f"{path}/state.safetensors"
    return state, tensors_from_bytes(files["state.safetensors"], where=where, finite=False)


def _changes(old: Any, new: Any, where: str = "") -> list[str]:
    """Return a phrase for each value that differs between two nested dictionaries."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        names = list(dict.fromkeys([*old, *new]))
        return [
            c for name in names for c in _changes(old.get(name), new.get(name), f"{where}.{name}".lstrip("."))
        ]
    if old == new:
        return []
    if where == "data":
        return ["the data has changed"]
    return [f"{where} was {old} and is {new}"]
