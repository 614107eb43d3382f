"""What kind of change was seen, when, and how large: from the effects' own sensitivities.

The wrench that the model *as the adapter began with it* lacks is compared, in blocks of half a second, with what a
change of drag, mass, buoyancy, actuators or a constant force would make of it. When, at some moment of the last half
minute, a change of any kind is far more plausible than none, that moment is the time of the change, and the kinds
are compared on the data since. The variance of what is taken for noise is the larger of what neighbouring residuals
show and what the model left before the change; after it, where even the best kind leaves more than that, what it
leaves. A kind is named only if every other one fits clearly worse: where two fit alike, the excitation cannot tell
them apart, and the answer is "unclear".
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.answer_types import ChangeKind, Parameters
from auvnn.models import GreyBox
from auvnn.online.change_detection.blocks import ITEMS, _blocks, _joined, _Open
from auvnn.online.change_detection.change_statistics import Block, Fit, fit, gains
from auvnn.online.change_detection.change_words import Change, _words
from auvnn.online.change_detection.sensitivities import KINDS, Columns, Sensitivities
from auvnn.online.noise import NoiseLevel
from auvnn.online.residual import Sample

Array = NDArray[np.float64]

BLOCK = 0.5  # s
MOST_IN_BLOCK = 32  # samples of a block that are used; evenly thinned where there are more
KEPT = 60  # blocks
FEWEST_BEFORE, FEWEST_AFTER = 4, 3
# Logarithm of the odds that a change must reach, looks at many moments and kinds included.
SURE = 20.0
# Half the fall of the squared residual by which the best kind must beat every other.
APART = 6.0
# Share of the new residual that a kind must explain to be named.
EXPLAINED = 0.7
AROUND = 3  # blocks by which the moment may still be moved
SETTLE = 10.0  # s over which the kind may still be revised
MOST_CHANGES = 100
UNDETERMINED = 0.5  # of the plausible size: what is not known better than this is not given


class Monitor:
    """Watches the missing wrench for changes; bounded in memory, about a hundredth of a second per block.

    Args:
        model: from which residuals are taken.
        scale: (6,) size of the forces at hand, N and N m; noise is at least a hundredth of it.
    """

    def __init__(self, model: GreyBox, scale: Tensor) -> None:
        """Work out which effects can be told from the model."""
        self.sensitivities = Sensitivities(model)
        self.floor = 0.01 * scale.numpy()
        self._scale = self.sensitivities.scale
        self._kinds = {
            kind: self.sensitivities.of(names)
            for kind, names in KINDS.items()
            if self.sensitivities.of(names)
        }
        self._noise = NoiseLevel(1e-12)
        self._pending: list[tuple[Sample, Tensor, Tensor]] = []
        self._blocks: deque[Block] = deque(maxlen=KEPT)
        self._baseline = np.zeros(self.sensitivities.width)
        self._open: _Open | None = None
        self.changes: list[Change] = []

    def use(self, model: GreyBox) -> None:
        """Go on with another known part; what was collected belongs to the former one's sensitivities."""
        former = self.sensitivities
        self.sensitivities = Sensitivities(model)
        if former.width != self.sensitivities.width:
            self._blocks.clear()
            self._baseline = np.zeros(self.sensitivities.width)
            self._scale = self.sensitivities.scale
            self._kinds = {k: c for k, n in KINDS.items() if (c := self.sensitivities.of(n))}

    def add(self, sample: Sample, nu: Tensor, missing: Tensor) -> None:
        """Take in what the original model lacks at a sample, N and N m.

        Args:
            sample: what was measured.
            nu: velocity at which the wrench is missing, (6,), m/s and rad/s.
            missing: wrench, (6,), N and N m.
        """
        if self._pending and sample.t - self._pending[0][0].t >= BLOCK:
            self._close_block()
        self._noise.add(missing)
        self._pending.append((sample, nu, missing))
        if len(self._pending) > 4 * MOST_IN_BLOCK:
            del self._pending[1::2]

    def _close_block(self) -> None:
        pending, self._pending = self._pending, []
        step = max(1, -(-len(pending) // MOST_IN_BLOCK))
        used = pending[::step]
        slopes = self.sensitivities.at([s for s, _, _ in used], [nu for _, nu, _ in used])
        missing = np.stack([m.numpy() for _, _, m in used])
        block = Block.of(pending[0][0].t, slopes, missing).without(self._baseline)
        self._blocks.append(block)
        if self._open is not None:
            self._revise(block)
        else:
            self._look()

    def _variance(self, before: list[Block]) -> Array:
        """Return what is taken for noise (6,): of neighbours' differences, or what the model left before."""
        level = np.maximum(self._noise.std(), self.floor) ** 2
        if not before:
            return level
        count = np.array([b.count for b in before])
        squares = np.array([b.square for b in before]) / count[:, None]
        return np.maximum(level, np.median(squares, axis=0) * self._correlated(before))

    def _correlated(self, before: list[Block]) -> Array:
        """Return by how much blocks' means vary more than white noise would have them, at least one, (6,)."""
        if len(before) < FEWEST_BEFORE:
            return np.ones(6)
        count = np.array([b.count for b in before])[:, None]
        means = np.array([b.total for b in before]) / count
        spread = np.array([b.square for b in before]).sum(0) / count.sum()
        return np.clip((count * means**2).mean(0) / np.maximum(spread, 1e-300), 1.0, count.mean())

    def _look(self) -> None:
        """Look for a moment since which a change is far more plausible than none."""
        blocks = list(self._blocks)
        last = len(blocks) - FEWEST_AFTER
        evidence, where = self._moment(blocks, FEWEST_BEFORE, last)
        if evidence < SURE:
            return
        # The same once more, with what the model left before the moment found.
        found = self._judge(blocks[:where], blocks[where:])
        if found is None:
            return
        self._open = _Open(blocks[:where], found, blocks[where:])
        self.changes.append(found)
        del self.changes[:-MOST_CHANGES]

    def _moment(self, blocks: list[Block], first: int, last: int) -> tuple[float, int]:
        """Return the largest evidence of a change between blocks `first` and `last`, and its block."""
        if last < first:
            return -np.inf, first
        variance = self._variance(blocks[:first])
        parts = [b.weighted(variance) for b in blocks]
        # Sums from each block to the last.
        hessian = np.cumsum(np.stack([p[0] for p in parts])[::-1], axis=0)[::-1]
        slope = np.cumsum(np.stack([p[1] for p in parts])[::-1], axis=0)[::-1]
        best, where = -np.inf, first
        rows = np.arange(first, last + 1)
        for columns in self._kinds.values():
            c = _joined(columns)
            found = gains(hessian[rows][:, c[:, None], c], slope[rows][:, c], self._scale[c])
            # Of moments that are as plausible, the latest: what came before needs no change.
            k = len(found) - 1 - int(np.argmax(found[::-1]))
            if found[k] > best:
                best, where = float(found[k]), int(rows[k])
        return best, where

    def _judge(self, before: list[Block], after: list[Block]) -> Change | None:
        """Compare the kinds on the blocks since a moment; None where no change is certain."""
        variance = self._variance(before)
        parts = [b.weighted(variance) for b in after]
        hessian, slope = sum(p[0] for p in parts), sum(p[1] for p in parts)
        square, count = sum(p[2] for p in parts), 6.0 * sum(b.count for b in after)
        assert isinstance(hessian, np.ndarray) and isinstance(slope, np.ndarray)

        def fitted(columns: list[Columns], heat: float = 1.0) -> Fit:
            c = _joined(columns)
            return fit(hessian[np.ix_(c, c)], slope[c], float(square), self._scale[c], heat)

        first = {kind: fitted(columns) for kind, columns in self._kinds.items()}
        if max(f.evidence for f in first.values()) < SURE:
            return None
        # Where even the best leaves more than noise, neighbours' errors are alike: a block counts as one look.
        least = min(f.left for f in first.values()) / count
        heat = 1.0 if least <= 1.5 else least * max(1.0, count / 6.0 / len(after))
        fits = {kind: fitted(columns, heat) for kind, columns in self._kinds.items()}
        above = max(float(square) - count, 1e-12)
        share = {kind: 1.0 - max(f.left - count, 0.0) / above for kind, f in fits.items()}
        order = sorted(fits, key=lambda kind: -fits[kind].evidence)
        kind, best = order[0], fits[order[0]]
        rivals = [k for k in order[1:] if (fits[k].left - best.left) / (2.0 * heat) < APART]
        named = kind if not rivals and share[kind] >= EXPLAINED and best.evidence > APART else "unclear"
        effect, parameters = self._told(kind, fitted, heat)
        start = after[0].start
        words = _words(named, kind, rivals, effect, parameters, start, share[kind])
        listing: list[ChangeKind] = [
            {"kind": k, "evidence": fits[k].evidence, "explained": max(0.0, share[k])} for k in order
        ]
        detected = after[-1].start + BLOCK
        told = (effect, parameters) if named != "unclear" else (None, {})
        return Change(start, detected, named, *told, best.evidence, max(0.0, share[kind]), listing, words)

    def _told(self, kind: str, fitted: Any, heat: float) -> tuple[str, Parameters]:
        """Return the effect of a kind that says it best alone, and its parameters."""
        alone = {c.effect: (fitted([c], heat), c) for c in self._kinds[kind]}
        effect = max(alone, key=lambda name: alone[name][0].evidence)
        found, columns = alone[effect]
        std = np.sqrt(np.diag(found.covariance))
        off = {
            p.name: abs(columns.now[i] + found.theta[i] - p.null) / std[i]
            for i, p in enumerate(columns.parameters)
        }
        parameters: Parameters = {
            p.name: {"value": float(columns.now[i] + found.theta[i]), "std": float(std[i]), "unit": p.unit}
            for i, p in enumerate(columns.parameters)
            if std[i] < UNDETERMINED * p.scale
        }
        # Those that have changed most certainly come first.
        return effect, dict(sorted(parameters.items(), key=lambda item: -off[item[0]]))

    def _revise(self, block: Block) -> None:
        """Judge an open change again with one more block, and close it when it has settled."""
        opened = self._open
        assert opened is not None
        whole = [*opened.before, *opened.blocks, block]
        # The moment was found when hardly anything had been seen of the change: look again around it.
        middle = len(opened.before)
        first, last = max(FEWEST_BEFORE, middle - AROUND), min(middle + AROUND, len(whole) - FEWEST_AFTER)
        middle = self._moment(whole, first, last)[1] if last >= first else middle
        opened.before, opened.blocks = whole[:middle], whole[middle:]
        found = self._judge(opened.before, opened.blocks)
        if found is not None:
            found.detected = opened.found.detected
            self.changes[-1] = opened.found = found
        if block.start - opened.found.detected < SETTLE:
            return
        # From here on the changed vehicle is what further changes are measured against.
        kind = opened.found.kinds[0]["kind"]
        variance = self._variance(opened.before)
        parts = [b.weighted(variance) for b in opened.blocks]
        hessian, slope = np.sum([p[0] for p in parts], axis=0), np.sum([p[1] for p in parts], axis=0)
        c = _joined(self._kinds[kind])
        theta = np.zeros_like(self._baseline)
        theta[c] = fit(hessian[np.ix_(c, c)], slope[c], 0.0, self._scale[c]).theta
        self._baseline = self._baseline + theta
        self._blocks.clear()
        self._blocks.extend(b.without(theta) for b in opened.blocks)
        self._open = None

    def state(self) -> tuple[dict[str, Any], dict[str, Tensor]]:
        """Return plain data and tensors that are remembered."""
        tensors = {"noise.ring": self._noise.state()["ring"], "baseline": torch.tensor(self._baseline)}
        lists = {"blocks": list(self._blocks)}
        if self._open is not None:
            lists |= {"open": self._open.blocks, "before": self._open.before}
        for name, blocks in lists.items():
            for item in ITEMS:
                values = [getattr(b, item) for b in blocks]
                tensors[f"{name}.{item}"] = torch.tensor(np.array(values, dtype=np.float64))
        for k, (_, nu, missing) in enumerate(self._pending):
            tensors |= {f"pending.{k}.nu": nu, f"pending.{k}.missing": missing}
        plain = {
            "changes": [c.to_dict() for c in self.changes],
            "open": self._open is not None,
            "pending": len(self._pending),
        }
        return plain, tensors

    def load(self, plain: Mapping[str, Any], tensors: Mapping[str, Tensor], pending: list[Sample]) -> None:
        """Take up a state; `pending` are the samples of the block that was being filled.

        Args:
            plain: numbers and words, as `state` returns them.
            tensors: by name, likewise.
            pending: samples of the block that was being filled.
        """
        self._noise.load({"ring": tensors["noise.ring"]})
        self._baseline = tensors["baseline"].numpy().copy()
        self.changes = [Change(**c) for c in plain["changes"]]
        self._blocks.clear()
        self._blocks.extend(_blocks(tensors, "blocks"))
        self._open = None
        if plain["open"]:
            self._open = _Open(_blocks(tensors, "before"), self.changes[-1], _blocks(tensors, "open"))
        self._pending = [
            (sample, tensors[f"pending.{k}.nu"], tensors[f"pending.{k}.missing"])
            for k, sample in enumerate(pending)
        ]

    def new_run(self) -> None:
        """Drop the block that was being filled: the next sample is from another run."""
        self._pending = []

    @property
    def pending(self) -> list[Sample]:
        """The samples of the block that is being filled."""
        return [sample for sample, _, _ in self._pending]
