"""Blocks of samples: rows that are made into matrices as they are asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from auvnn.online.change_detection.change_statistics import Block
from auvnn.online.change_detection.change_words import Change
from auvnn.online.change_detection.sensitivities import Columns

ITEMS = ("start", "count", "hessian", "slope", "square", "total", "reach")


@dataclass
class _Open:
    """A change that is still being judged."""

    before: list[Block]
    found: Change
    blocks: list[Block]


def _blocks(tensors: Mapping[str, Tensor], name: str) -> list[Block]:
    items = [tensors[f"{name}.{i}"].numpy() for i in ITEMS]
    return [
        Block(float(start), float(count), *(m.copy() for m in more))
        for start, count, *more in zip(*items, strict=True)
    ]


def _joined(columns: list[Columns]) -> NDArray[np.int64]:
    return np.concatenate([np.arange(c.columns.start, c.columns.stop) for c in columns])
