"""What the subnetworks should give, worked out once for each piece of a log and kept on the disk, 96 bytes a sample.

A worker that finds nothing there (on another machine, or because it was cleared) works it out again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import tempfile
import uuid
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.executors.packing import pack
from auvnn.log_chunks.samples import Piece, inside, run_of
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.metrics.derivative import Derivative
from auvnn.models import GreyBox
from auvnn.training.targets import Targets

Array = NDArray[np.float64]

_own: dict[str, tempfile.TemporaryDirectory[str]] = {}


@lru_cache(maxsize=16)
def unpack_targets(data: bytes) -> Any:
    """Return what was packed; many questions hold the same."""
    return pickle.loads(data)


@dataclass(frozen=True)
class Source:
    """Where the samples of pieces come from.

    Attributes:
        packed: model, derivative and mapping, as bytes: they are sent with every question.
        scratch: folder for what was worked out; a process that does not see it takes another one.
        token: another one for each training.
    """

    packed: bytes
    scratch: Path
    token: str

    @classmethod
    def of(cls, model: GreyBox, derivative: Derivative, mapping: Mapping, scratch: Path) -> Source:
        """Return a source.

        Args:
            model: its damping subnetworks do not count.
            derivative: how accelerations are obtained.
            mapping: of the columns.
            scratch: folder for what is worked out.
        """
        return cls(pack((model, derivative, mapping)), scratch, uuid.uuid4().hex)

    def samples(self, piece: Piece) -> Array:
        """Return velocity and target of a piece's samples that can be used, (n, 12); NaN where a target is missing."""
        place = self._folder() / f"{piece.name}.npy"
        try:
            return np.load(place)
        except (OSError, ValueError):
            pass
        found = self.worked_out(piece)
        unfinished = place.with_suffix(f".{os.getpid()}.partial")
        with unfinished.open("wb") as stream:
            np.save(stream, found)
        unfinished.replace(place)
        return found

    def _folder(self) -> Path:
        if self.scratch.is_dir():
            return self.scratch
        # On another machine: a folder that goes with this process.
        if self.token not in _own:
            _own[self.token] = tempfile.TemporaryDirectory(prefix="auvnn-")
        return Path(_own[self.token].name)

    def worked_out(self, piece: Piece) -> Array:
        """Return what `samples` does, from the log itself."""
        model, derivative, mapping = unpack_targets(self.packed)
        run = run_of(piece, mapping)
        nu, target = Targets(model, derivative)(run, piece.opening)
        mine = inside(piece, run)
        found = np.concatenate([nu[mine], target[mine]], axis=1)
        good = np.isfinite(found[:, :6]).all(1)
        found[:, 6:][~np.isfinite(found[:, 6:])] = np.nan
        return found[good & np.isfinite(found[:, 6:]).any(1)]


@dataclass(frozen=True)
class SampleCount:
    """What is known of a piece's usable samples: how many, by degree of freedom, and a digest of them."""

    samples: int
    counts: tuple[int, ...]
    digest: str


def count_samples(source: Source, piece: Piece) -> SampleCount:
    """Work out a piece's samples and count them."""
    torch.set_num_threads(1)
    found = source.samples(piece)
    counts = np.isfinite(found[:, 6:]).sum(0)
    return SampleCount(len(found), tuple(counts.tolist()), hashlib.sha256(found.tobytes()).hexdigest())
