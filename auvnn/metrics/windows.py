"""Cut a log into windows: stretches over which a model runs free from a measured state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from auvnn.errors import InputError
from auvnn.logs import Log, Run
from auvnn.logs.altitude import altitude_over_intervals
from auvnn.metrics.coloured_noise import NoiseColour
from auvnn.metrics.force_law import ForceLaw
from auvnn.models.inputs import Inputs

CHANNELS = (
    "x", "y", "z", "phi", "theta", "psi", "u", "v", "w", "p", "q", "r", "du", "dv", "dw", "dp", "dq", "dr",
)  # fmt: skip
POSITION, ATTITUDE, VELOCITY, ACCELERATION = slice(0, 3), slice(3, 6), slice(6, 12), slice(12, 18)
# Longest step of an integrator, s, where nothing asks for a shorter one.
MAX_STEP = 0.05


@dataclass(frozen=True)
class Windows:
    """B windows of at most L samples, each with `warmup` rows of history for the actuators.

    Windows shorter than L are padded with their last row at an unchanged time and an empty mask.

    Attributes:
        run: (B,) run numbers.
        first: (B,) index of the first sample in its run.
        times: (B, warmup + L), s.
        eta: (B, L, 7); zeros where there is no position.
        nu: (B, L, 6), m/s and rad/s.
        nu_dot: (B, L, 6), or None where accelerations were not measured.
        inputs: commands and the like, (B, warmup + L, ...).
        mask: (B, L, 18), 1 where a channel of `CHANNELS` was measured, else 0.
        length: (B,) samples before the padding.
        warmup: rows of history.
        max_step: longest step with which an integrator may run them, s.
        law: of a stochastic force that acts in them; None for none.
        noise: of the sensors, where it is not white.
        estimated: channels that were estimated and not measured: free running starts from them, and they do not count.
        around: states (B, L, 13) of a trajectory about which the motion is linear; None for that of free running.
    """

    run: np.ndarray
    first: np.ndarray
    times: Tensor
    eta: Tensor
    nu: Tensor
    nu_dot: Tensor | None
    inputs: Inputs
    mask: Tensor
    length: np.ndarray
    warmup: int
    max_step: float = MAX_STEP
    law: ForceLaw | None = None
    noise: NoiseColour | None = None
    estimated: tuple[str, ...] = ()
    around: Tensor | None = None

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.run)

    @property
    def has_position(self) -> bool:
        """Whether any position was measured."""
        return bool(self.mask[..., POSITION].any())

    def whitened(self, values: Tensor) -> Tensor:
        """Return the innovations of errors, or of their derivatives, (B, L, C, ...), where the noise is not white."""
        return (
            values
            if self.noise is None
            else self.noise.whitened(values, self.mask, self.times[:, self.warmup :])
        )

    def pick(self, chosen: slice | np.ndarray) -> Windows:
        """Return some of the windows."""
        index = chosen if isinstance(chosen, slice) else torch.as_tensor(chosen)
        return replace(
            self,
            run=self.run[chosen],
            first=self.first[chosen],
            times=self.times[index],
            eta=self.eta[index],
            nu=self.nu[index],
            nu_dot=None if self.nu_dot is None else self.nu_dot[index],
            inputs=self.inputs.mapped(lambda x: x[index]),
            mask=self.mask[index],
            length=self.length[chosen],
            around=None if self.around is None else self.around[index],
        )


def starts(
    run: Run,
    part: slice,
    horizon: float,
    stride: float,
    partial: bool,
    begin: float | None = None,
    until: float = np.inf,
) -> tuple[list[tuple[int, int]], float]:
    """Return first and last sample (included) of the windows of one stretch, and the time from which the next begins.

    Args:
        run: the run.
        part: the stretch.
        horizon: length, s.
        stride: from start to start, s.
        partial: also keep a last window of at least half the length.
        begin: where the first window begins, s; where the stretch does by default.
        until: the stretch goes on beyond `part`, which is believed up to then, s: windows that end later are left out.
    """
    t = run.t[part]
    usable = run.valid[part]
    # A start from an old velocity is off by what has changed since; sensors out of step leave no better one.
    fresh = usable & ~run.stale[part, 6:9].any(axis=1)
    usable = fresh if fresh.any() else usable
    found: list[tuple[int, int]] = []
    begin = float(t[0]) if begin is None else begin
    tolerance = 1e-6 * run.dt + 1e-3 * run.dt
    while begin <= t[-1] - run.dt:
        at = int(np.searchsorted(t, begin - tolerance))
        while at < len(t) and not usable[at]:
            at += 1
        if at >= len(t) - 1:
            break
        end = int(np.searchsorted(t, t[at] + horizon + tolerance)) - 1
        complete = t[-1] >= t[at] + horizon - tolerance
        if np.isfinite(until) and not (complete and t[end] <= until):
            break
        if end > at and (complete or (partial and t[end] - t[at] >= 0.5 * horizon)):
            found.append((part.start + at, part.start + end))
        if not complete:
            break
        begin = float(max(begin + stride, t[at] + run.dt))
    return found, begin


# A run, its commands, first and last sample of a window, and the first sample of its unbroken stretch.
Piece = tuple[Run, np.ndarray, int, int, int]


def commands(run: Run, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Return a run's commands (N, n), and which rows (N,) have commands and fin angles.

    Raises:
        InputError: the run has no such commands.
    """
    command = run.thrusters if kind == "thrusters" else run.wrench
    if command is None:
        wanted = "thruster_1 ..." if kind == "thrusters" else "tau_X ... tau_N"
        raise InputError(f"run {run.number} has no {wanted}: the model is driven by {kind}")
    known = np.asarray(np.isfinite(command).all(axis=1))
    if run.fins is not None:
        known &= np.isfinite(run.fins).all(axis=1)
    return command, known


def cut_windows(
    log: Log,
    horizon: float,
    stride: float | None = None,
    *,
    warmup: float = 0.0,
    kind: str | None = None,
    partial: bool = False,
) -> Windows:
    """Cut a log into windows.

    Windows never cross a gap, a fresh start of the pose or a row without commands or fin angles; they start at
    samples whose state was measured.

    Args:
        log: the log.
        horizon: length, s; infinity for whole stretches.
        stride: from start to start, s; the horizon by default.
        warmup: history for the actuators, s; rows before the unbroken stretch repeat its first one.
        kind: "thrusters" or "wrench": which commands to take; by default what the log has.
        partial: also keep a last window of at least half the length.

    Raises:
        InputError: the log has no such commands, or no stretch is long enough.
    """
    kind = kind or log.kind
    pieces: list[Piece] = []
    for run in log.runs:
        command, known = commands(run, kind)
        for part in run.unbroken(known):
            span = float(run.t[part.stop - 1] - run.t[part.start]) if np.isinf(horizon) else horizon
            found, _ = starts(run, part, span, stride or span, partial or bool(np.isinf(horizon)))
            pieces += [(run, command, a, b, part.start) for a, b in found]
    if not pieces:
        raise InputError(
            f"no stretch of {log.name} is {horizon:g} s long without a gap: choose a shorter horizon"
        )
    return gathered(pieces, warmup)


def gathered(pieces: Sequence[Piece], warmup: float) -> Windows:
    """Return windows that have been found, as tensors.

    Args:
        pieces: at least one.
        warmup: history for the actuators, s.
    """
    length = np.array([b - a + 1 for _, _, a, b, _ in pieces])
    rows = int(length.max())
    before = max((int(np.ceil(warmup / run.dt - 1e-6)) for run, *_ in pieces), default=0)
    index = []
    for _, _, a, b, begin in pieces:
        # Padding repeats the last row; history before the stretch repeats its first.
        index.append(np.clip(np.arange(a - before, a + rows), begin, b))

    def gather(get: Callable[[Run, np.ndarray], np.ndarray]) -> np.ndarray:
        return np.stack([get(run, command)[i] for (run, command, *_), i in zip(pieces, index, strict=True)])

    def optional(drives: Callable[[Run], np.ndarray | None]) -> np.ndarray | None:
        known = {run.number: drives(run) for run, *_ in pieces}
        if any(value is None for value in known.values()):
            return None
        return gather(lambda run, _: np.asarray(known[run.number]))

    times = gather(lambda run, _: run.t)
    # Repeated history gets separate times, so that the actuators have time to settle in it.
    for row, (run, _, a, _, begin) in enumerate(pieces):
        missing = max(0, before - (a - begin))
        times[row, :missing] = run.t[begin] - run.dt * np.arange(missing, 0, -1)
    measured = np.concatenate(
        [
            gather(
                lambda run, _, n=n, w=w: (
                    np.full((run.samples, w), np.nan) if getattr(run, n) is None else getattr(run, n)
                )
            )[:, before:]
            for n, w in (("position", 3), ("quaternion", 4), ("nu", 6), ("nu_dot", 6))
        ],
        axis=-1,
    )
    unseen = gather(_unseen)[:, before:]
    seen = np.isfinite(measured)
    attitude = np.repeat(seen[..., 3:7].all(-1, keepdims=True), 3, axis=-1)
    mask = np.concatenate([seen[..., :3], attitude, seen[..., 7:]], axis=-1) & ~unseen
    mask &= (np.arange(rows)[None, :] < length[:, None])[..., None]
    estimated = tuple(dict.fromkeys(n for run, *_ in pieces for n in run.estimated))
    mask[..., [CHANNELS.index(n) for n in estimated]] = False
    filled = np.where(seen, measured, 0.0)
    filled[..., 3] = np.where(attitude[..., 0], filled[..., 3], 1.0)
    held = (lambda run: run.fins, lambda run: run.filled("voltage"), altitude_over_intervals)
    inputs = Inputs(
        _double(gather(lambda _, command: command)),
        *(None if x is None else _double(x) for x in map(optional, held)),
    )
    eta = _double(filled[..., :7])
    has_rate = bool(mask[..., ACCELERATION].any())
    return Windows(
        np.array([run.number for run, *_ in pieces]),
        np.array([a for _, _, a, *_ in pieces]),
        _double(times),
        eta,
        _double(filled[..., 7:13]),
        _double(filled[..., 13:]) if has_rate else None,
        inputs,
        _double(mask),
        length,
        before,
        estimated=estimated,
    )


def _double(values: np.ndarray) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def _unseen(run: Run, _: np.ndarray) -> np.ndarray:
    """Return what is no measurement of its moment, by channel (N, 18): single-sample outliers and repeated values."""
    found = np.zeros((run.samples, 18), dtype=bool)
    found[:, :12] = run.stale
    masks = run.outliers
    for k, name in enumerate(CHANNELS):
        if name in masks:
            found[:, k] |= masks[name]
    return found
