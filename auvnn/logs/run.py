"""One run: an unbroken recording of one vehicle, as named arrays in SI units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.cards import Card, Shown
from auvnn.catalogue import unknown_name
from auvnn.errors import InputError
from auvnn.logs.channels import ACCELERATION, EULER, POSITION, QUATERNION, RESET, SCALARS, VELOCITY, WRENCH
from auvnn.logs.signals.repeats import stale
from auvnn.logs.signals.rotation import to_euler
from auvnn.logs.signals.segments import stretches

Array = NDArray[np.float64]

_WIDTHS = {
    **{"quaternion": 4, "nu": 6, "nu_dot": 6, "position": 3, "wrench": 6},
    **dict.fromkeys((*SCALARS, RESET), 0),
}
_BLOCKS = {
    "quaternion": QUATERNION,
    "nu": VELOCITY,
    "nu_dot": ACCELERATION,
    "position": POSITION,
    "wrench": WRENCH,
}
MIN_SAMPLES = 3


@dataclass(frozen=True, eq=False, repr=False)
class Run(Shown):
    """One run of a log; NaN marks a missing sample, rows of different runs are never joined.

    Args:
        number: the run's number in its log.
        t: time, s, (N,), strictly increasing, N >= 3, not necessarily even.
        quaternion: attitude body (FRD) to world (NED), (w, x, y, z), (N, 4).
        nu: body velocity of the body origin [u v w p q r], m/s and rad/s, (N, 6).
        nu_dot: its time derivative by component, m/s2 and rad/s2, (N, 6), where it was measured.
        position: north, east, down, m, (N, 3).
        wrench: commanded [X Y Z K M N], N and N m, (N, 6).
        thrusters: commands in [-1, 1], (N, n); row k is held from t_k until t_{k+1}.
        fins: fin angles, rad, (N, m).
        altitude: height above the bottom, m, (N,).
        voltage: battery, V, (N,).
        ballast: volume that changes at constant mass, m3, (N,); larger is lighter.
        density: of the water, kg/m3, (N,).
        moving_mass: shift of a moving mass along its axis, m, (N,).
        reset: counter of the estimator's resets or number of its core, (N,): where it changes, the pose starts again.
        extra: columns outside the contract, kept as they were, (N,) each.
        estimated: channels whose values were not measured but estimated, where a vehicle has no sensor for them: free
            running starts from them, and nothing is scored or fitted by them.
        given: measured channels that drive the model rather than check it: nothing is scored by them.
        recorded: the run as it was recorded, where estimates stand in this one.

    Raises:
        InputError: shapes disagree, time does not increase, or there are fewer than three samples.
    """

    number: int
    t: Array
    quaternion: Array
    nu: Array
    nu_dot: Array | None = None
    position: Array | None = None
    wrench: Array | None = None
    thrusters: Array | None = None
    fins: Array | None = None
    altitude: Array | None = None
    voltage: Array | None = None
    reset: Array | None = None
    extra: dict[str, Array] = field(default_factory=dict)
    estimated: tuple[str, ...] = ()
    given: tuple[str, ...] = ()
    ballast: Array | None = None
    density: Array | None = None
    moving_mass: Array | None = None
    recorded: Run | None = None

    def __post_init__(self) -> None:
        """Make every array a read-only float64 view and check the shapes."""
        t = _frozen(self.t, "t", self.number)
        if t.ndim != 1 or len(t) < MIN_SAMPLES:
            raise InputError(f"run {self.number}: {t.size} samples; a run needs at least {MIN_SAMPLES}")
        if not (np.isfinite(t).all() and (np.diff(t) > 0).all()):
            raise InputError(f"run {self.number}: t must be finite and strictly increasing")
        object.__setattr__(self, "number", int(self.number))
        object.__setattr__(self, "t", t)
        blocks = ("quaternion", "nu", "nu_dot", "position", "wrench", "thrusters", "fins")
        for name in (*blocks, *_SCALAR, RESET):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, self._checked(name, value))
        extra = {k: self._checked(k, v, scalar=True) for k, v in self.extra.items()}
        object.__setattr__(self, "extra", extra)

    def _checked(self, name: str, value: Any, scalar: bool = False) -> Array:
        array = _frozen(value, name, self.number)
        width = 0 if scalar else _WIDTHS.get(name)
        good = array.ndim == (1 if width == 0 else 2) and len(array) == len(self.t)
        if good and width:
            good = array.shape[1] == width
        if not good:
            wanted = f"({len(self.t)},)" if width == 0 else f"({len(self.t)}, {width or 'n'})"
            raise InputError(f"run {self.number}: '{name}' has shape {array.shape}, expected {wanted}")
        return array

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    def __getitem__(self, name: str) -> Array:
        """Return a column (N,) by its name, `phi`, `theta` and `psi` among them.

        Raises:
            InputError: the run has no such column; the message offers the nearest name.
        """
        if name in EULER:
            return self.euler[:, EULER.index(name)]
        columns = dict(self.columns())
        if name not in columns:
            raise InputError(unknown_name(f"column of run {self.number}", str(name), [*columns, *EULER]))
        return columns[name]

    def __contains__(self, name: object) -> bool:
        """Say whether the run has a column of this name."""
        return name in EULER or name in dict(self.columns())

    def card(self) -> Card:
        """Return the run's length, rate and columns."""
        line = f"{self.samples} samples over {self.duration:.4g} s at {1.0 / self.dt:.3g} Hz, driven by {self.kind}"
        return Card(f"Run {self.number}", line, [f"Columns: {', '.join(self.channels)}."])

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.t)

    @property
    def duration(self) -> float:
        """From the first to the last stamp, s."""
        return float(self.t[-1] - self.t[0])

    @cached_property
    def dt(self) -> float:
        """Median time step, s."""
        return float(np.median(np.diff(self.t)))

    @property
    def kind(self) -> str:
        """What actuates the run: "thrusters" where there are thruster commands, else "wrench"."""
        return "thrusters" if self.thrusters is not None else "wrench"

    @property
    def command(self) -> Array | None:
        """The thruster commands where there are any, else the wrench."""
        return self.thrusters if self.thrusters is not None else self.wrench

    def filled(self, name: str) -> Array | None:
        """Return `altitude` or `voltage` without gaps, (N,): linear in time between samples, held at the ends."""
        value = getattr(self, name)
        if value is None or np.isfinite(value).all():
            return value
        seen = np.isfinite(value)
        return np.interp(self.t, self.t[seen], value[seen]) if seen.any() else None

    @cached_property
    def euler(self) -> Array:
        """Roll, pitch, yaw (ZYX), rad, (N, 3); NaN where the attitude is missing."""
        return to_euler(self.quaternion)

    @property
    def eta(self) -> Array:
        """Position and quaternion [x y z qw qx qy qz], (N, 7); zeros for a position that is not there."""
        position = np.zeros((self.samples, 3)) if self.position is None else self.position
        return np.concatenate([position, self.quaternion], axis=1)

    def columns(self) -> Iterator[tuple[str, Array]]:
        """Yield the canonical columns that are there, then the extra ones, as (name, (N,))."""
        yield "t", self.t
        for block, names in _BLOCKS.items():
            value = getattr(self, block)
            if value is not None:
                yield from zip(names, value.T, strict=True)
        for block, kind in (("thrusters", "thruster"), ("fins", "fin")):
            value = getattr(self, block)
            if value is not None:
                yield from ((f"{kind}_{i + 1}", column) for i, column in enumerate(value.T))
        for name in _SCALAR:
            if getattr(self, name) is not None:
                yield name, getattr(self, name)
        if self.reset is not None:
            yield RESET, self.reset
        yield from self.extra.items()

    @cached_property
    def channels(self) -> dict[str, Array]:
        """The measured columns with at least one sample, by name; `"z" in run.channels` asks for the depth."""
        return {
            name: column
            for name, column in self.columns()
            if name not in self.estimated and not np.isnan(column).all()
        }

    @cached_property
    def measured(self) -> Run:
        """The run as it was recorded; itself where nothing was estimated."""
        return self if self.recorded is None else self.recorded

    @cached_property
    def outliers(self) -> dict[str, NDArray[np.bool_]]:
        """Masks (N,) of single-sample spikes, by channel; those of commands and attitude are not looked for."""
        from auvnn.logs.signals.outliers import spikes

        wanted = (*VELOCITY, *ACCELERATION, *POSITION, *_SCALAR)
        return {name: spikes(self.channels[name]) for name in wanted if name in self.channels}

    @cached_property
    def stale(self) -> NDArray[np.bool_]:
        """Samples (N, 12) of position, attitude and velocity that only repeat the last one of a slower sensor."""
        return stale(self.position, self.quaternion, self.nu)

    @cached_property
    def cleaned(self) -> Run:
        """The run with single-sample spikes of velocity and acceleration read as missing; itself without any."""
        changes: dict[str, Any] = {}
        for block, names in (("nu", VELOCITY), ("nu_dot", ACCELERATION)):
            values = getattr(self, block)
            none = np.zeros(self.samples, dtype=bool)
            mask = np.stack([self.outliers.get(name, none) for name in names], axis=1)
            if values is not None and mask.any():
                changes[block] = np.where(mask, np.nan, values)
        return replace(self, **changes) if changes else self

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """Samples (N,) with attitude, velocity and command all there."""
        needed = [self.quaternion, self.nu, *([] if self.command is None else [self.command])]
        return np.logical_and.reduce([np.isfinite(a).all(axis=1) for a in needed])

    @cached_property
    def restarts(self) -> NDArray[np.intp]:
        """First samples after the pose has started again: an estimator's reset, a moved origin, another core."""
        from auvnn.logs.reading.repairs.resets import restarts

        return restarts(self)

    def unbroken(
        self, valid: NDArray[np.bool_], max_gap: float | None = None, min_samples: int = 2
    ) -> list[slice]:
        """Return the stretches of samples that count, without a gap in time or a fresh start of the pose.

        Args:
            valid: samples that count, (N,).
            max_gap: longest step within a stretch, s; five median steps where None.
            min_samples: shorter stretches are left out.
        """
        return stretches(self.t, valid, max_gap, min_samples, self.restarts)

    def segments(self, max_gap: float | None = None, min_samples: int = 2) -> list[slice]:
        """Return the stretches without a gap in time, a fresh start of the pose or a missing required sample.

        Args:
            max_gap: longest step within a stretch, s; five median steps where None.
            min_samples: shorter stretches are left out.
        """
        return self.unbroken(self.valid, max_gap, min_samples)

    def cut(self, part: slice, number: int | None = None) -> Run:
        """Return a part of the run as a separate run, under the same number unless another is given."""
        changes: dict[str, Any] = {"number": self.number if number is None else number}
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name == "extra":
                changes["extra"] = {k: v[part] for k, v in value.items()}
            elif isinstance(value, np.ndarray):
                changes[item.name] = value[part]
        if self.recorded is not None:
            changes["recorded"] = self.recorded.cut(part, number)
        return replace(self, **changes)


_SCALAR = SCALARS


def _frozen(value: Any, name: str, number: int) -> Array:
    try:
        array = np.asarray(value, dtype=np.float64).view()
    except (TypeError, ValueError) as problem:
        raise InputError(f"run {number}: '{name}' is not an array of numbers: {problem}") from problem
    # A log is shared by many readers: nobody may change it under another's hands.
    array.flags.writeable = False
    return array
