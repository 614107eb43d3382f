"""Of each window only those products of columns that tests of many effects ask for.

A test of one effect needs, window by window, the products of its columns with one another and with those of the base.
Products of two effects that are tested separately are needed in total at most. With forty effects in several shapes
the matrix of each window would be the largest thing in a diagnosis, and nine tenths of it would never be read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

Array = NDArray[np.float64]
Columns = NDArray[Any]


@dataclass(frozen=True)
class Wanted:
    """Which products of columns are asked for.

    Attributes:
        base: columns of which the products with all others are kept of each window, (f,).
        blocks: columns of which the products with one another are kept of each window.
        pairs: whether the products of all columns are asked for in total.
    """

    base: Columns
    blocks: Sequence[Columns]
    pairs: bool = False


@dataclass(frozen=True)
class KeptProducts:
    """Products of the columns of B windows.

    Attributes:
        wanted: which of them there are.
        whole: of all windows together, (P, P); zero where it was not asked for.
        across: of the base with all columns, (B, f, P).
        inner: of blocks of one size, (B, G, p, p), by that size.
    """

    wanted: Wanted
    whole: Array
    across: Array
    inner: dict[int, Array]

    def block(self, columns: Columns) -> Array:
        """Return the products of some columns with one another, (B, k, k).

        Args:
            columns: of the base, or all in one block, or some of each.

        Raises:
            KeyError: such products were not asked for.
        """
        place = {int(c): k for k, c in enumerate(self.wanted.base)}
        held = np.array([int(c) in place for c in columns], dtype=bool)
        found = np.empty((len(self.across), len(columns), len(columns)))
        rows = self.across[:, [place[int(c)] for c in columns[held]]][:, :, columns]
        found[:, held], found[:, :, held] = rows, rows.transpose(0, 2, 1)
        if not held.all():
            rest = np.flatnonzero(~held)
            found[:, rest[:, None], rest] = self._of_a_block(columns[rest])
        return found

    def _of_a_block(self, columns: Columns) -> Array:
        for size, group in _by_size(self.wanted.blocks).items():
            for k, block in enumerate(group):
                at = {int(c): i for i, c in enumerate(block)}
                if all(int(c) in at for c in columns):
                    index = np.array([at[int(c)] for c in columns])
                    return self.inner[size][:, k, index[:, None], index]
        raise KeyError(f"products of the columns {columns.tolist()} were not kept")

    def without(self, bad: NDArray[np.bool_]) -> KeptProducts:
        """Return the same with zeros in the place of what some columns, (P,), are in."""
        whole, across = self.whole.copy(), np.nan_to_num(self.across)
        whole[bad], whole[:, bad] = 0.0, 0.0
        across[:, bad[self.wanted.base]], across[:, :, bad] = 0.0, 0.0
        inner = {size: np.nan_to_num(sums) for size, sums in self.inner.items()}
        for size, group in _by_size(self.wanted.blocks).items():
            for k, block in enumerate(group):
                inner[size][:, k, bad[block]] = 0.0
                inner[size][:, k, :, bad[block]] = 0.0
        return replace(self, whole=np.nan_to_num(whole), across=across, inner=inner)


class Collecting:
    """Collects the products of windows that come in parts.

    Args:
        wanted: which products.
        windows: how many windows there will be, B.
    """

    def __init__(self, wanted: Wanted, windows: int) -> None:
        """Make room for what is kept once the number of columns is known."""
        self.wanted, self.windows = wanted, windows
        self.groups = {
            size: torch.as_tensor(np.stack(group)) for size, group in _by_size(wanted.blocks).items()
        }
        self.whole = self.across = np.zeros(0)
        self.inner = {k: np.empty((windows, len(g), k, k)) for k, g in self.groups.items()}

    def add(self, here: slice, columns: Tensor, along: Tensor) -> Tensor:
        """Add some windows, the errors first among their columns; return the products of the errors, (b, 1 + P).

        Args:
            here: which windows they are.
            columns: errors and sensitivities, weighted, (b, n, 1 + P).
            along: the part of each that initial states take, in an orthonormal basis of it, (b, 12, 1 + P).
        """
        self._make_room(columns.shape[-1] - 1)
        first = torch.as_tensor(np.concatenate([[0], 1 + self.wanted.base]))
        rows = (columns[..., first].mT @ columns).sub_(along[..., first].mT @ along)
        self.across[here] = rows[:, 1:, 1:].numpy()
        for size, group in self.groups.items():
            # (b, n, G p) to (b, G, n, p)
            own, taken = (x[..., 1 + group].transpose(1, 2) for x in (columns, along))
            self.inner[size][here] = (own.mT @ own).sub_(taken.mT @ taken).numpy()
        if self.wanted.pairs:
            flat, less = columns[..., 1:].flatten(0, 1), along[..., 1:].flatten(0, 1)
            self.whole += (flat.mT @ flat).sub_(less.mT @ less).numpy()
        return rows[:, 0]

    def add_whole(self, here: slice, products: Tensor) -> Tensor:
        """Add some windows of which all products are known, (b, 1 + P, 1 + P); return those of the errors, (b, 1 + P)."""
        self._make_room(products.shape[-1] - 1)
        base = torch.as_tensor(self.wanted.base)
        self.across[here] = products[:, 1 + base, 1:].numpy()
        for size, group in self.groups.items():
            self.inner[size][here] = products[:, 1 + group[:, :, None], 1 + group[:, None]].numpy()
        if self.wanted.pairs:
            self.whole += products[:, 1:, 1:].sum(0).numpy()
        return products[:, 0]

    def kept(self) -> KeptProducts:
        """Return what was collected."""
        whole, base = self.whole, self.wanted.base
        if not self.wanted.pairs:
            for size, group in self.groups.items():
                whole[group[:, :, None].numpy(), group[:, None].numpy()] = self.inner[size].sum(0)
            total = self.across.sum(0)
            whole[base], whole[:, base] = total, total.T
        return KeptProducts(self.wanted, whole, self.across, self.inner)

    def _make_room(self, size: int) -> None:
        if self.across.ndim < 3:
            self.across = np.empty((self.windows, len(self.wanted.base), size))
            self.whole = np.zeros((size, size))


def _by_size(blocks: Sequence[Columns]) -> dict[int, list[Columns]]:
    found: dict[int, list[Columns]] = {}
    for block in blocks:
        found.setdefault(len(block), []).append(block)
    return found
