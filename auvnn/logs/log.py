"""The log: one vehicle's runs, the one currency of everything that measures, fits or compares."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from auvnn.errors import ConfigError, InputError
from auvnn.logs.channels import SCALARS, VELOCITY
from auvnn.logs.clock_origin import from_their_beginning
from auvnn.logs.notebook_view import ShownLog
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.run import MIN_SAMPLES, Run

if TYPE_CHECKING:
    from auvnn.logs.quality.quality import Quality


@dataclass(frozen=True, eq=False, repr=False)
class Log(ShownLog):
    """Runs of one vehicle, and what was done to them on reading.

    `len(log)` is the number of runs, `log[0]` the first of them, `log[1:]` a log of the others, `log["u"]` a column.

    Args:
        runs: the runs, with the same columns and different numbers; stamps of 1e7 s and more count from the earliest.
        name: what to call the log in words and file names.
        paths: the files it was read from; empty for a log made in memory.
        repairs: what was corrected or noted while reading.
        sha256: of the files' bytes where it was read, of the samples where it was made in memory; where only the
            beginning of a file was read, of that.
        unknown: columns that are kept and not used.
        unsealed: files in which damage that leaves numbers readable cannot be seen.

    Raises:
        InputError: there is no run, a number occurs twice, or the runs' columns differ.

    Example:
        ```python
        made = auvnn.simulate(auvnn.load("rov95"), runs=2, duration=5.0)
        first, second = made.log.runs  # first.t (N,), first.nu (N, 6), first.command (N, n)
        ```
    """

    runs: tuple[Run, ...]
    name: str = "log"
    paths: tuple[Path, ...] = ()
    repairs: tuple[Repair, ...] = ()
    sha256: str = ""
    unknown: tuple[str, ...] = field(default=(), kw_only=True)
    unsealed: tuple[Path, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        """Check that the runs belong together, and count stamps that are dates from the first of them."""
        runs, notes = from_their_beginning(self.runs, self.name)
        object.__setattr__(self, "runs", runs)
        object.__setattr__(self, "repairs", (*self.repairs, *notes))
        if not self.runs:
            raise InputError(f"log '{self.name}' has no run")
        numbers = [run.number for run in self.runs]
        if len(set(numbers)) != len(numbers):
            twice = sorted({n for n in numbers if numbers.count(n) > 1})
            raise InputError(f"log '{self.name}': run numbers {twice} occur twice; number the runs apart")
        first = blocks_of(self.runs[0])
        for run in self.runs[1:]:
            differ = sorted(first ^ blocks_of(run))
            if differ:
                raise InputError(
                    f"log '{self.name}': runs {self.runs[0].number} and {run.number} differ in "
                    f"{', '.join(differ)}: one log holds one vehicle; read them as separate logs"
                )
        if not self.sha256:
            object.__setattr__(self, "sha256", self._content_hash())

    @classmethod
    def read(
        cls,
        path: str | Path | Sequence[str | Path],
        mapping: Any = None,
        *,
        max_duration: float | None = None,
    ) -> Log:
        """Read a log from one file or several.

        Args:
            path: a table (CSV, Parquet), a recording (ROS, DataFlash, ULog, ...; see `READERS`), the folder of a
                ROS 2 bag, or a list of these; rows of different files are never joined.
            mapping: a mapping file's path, its content as a dict, or None for canonical columns.
            max_duration: of each file, s; what is recorded later is left out. A file larger than the memory can
                be read so.

        Raises:
            InputError: a file cannot be read or its content must not be trusted.
            ConfigError: the mapping is wrong.

        Example:
            ```python
            made = auvnn.simulate(auvnn.load("rov95"), runs=1, duration=8.0)
            made.log.write("dive.csv", overwrite=True)
            log = auvnn.Log.read("dive.csv", max_duration=4.0)
            ```
        """
        from auvnn.logs.reading.reading import read

        return cls(**vars(read(path, mapping, max_duration)))

    @classmethod
    def from_dataframe(cls, data: Any, mapping: Any = None, name: str = "data frame") -> Log:
        """Make a log of a table in memory, as if a file of the same columns had been read.

        Args:
            data: a pandas or polars data frame, or a dict of arrays (N,).
            mapping: a mapping file's path or its content as a dict; None for canonical columns.
            name: of the log.

        Raises:
            InputError: it is no table, or its content must not be trusted.
            ConfigError: the mapping is wrong.
        """
        from auvnn.logs.data_frames import from_dataframe

        return cls(**vars(from_dataframe(data, mapping, name)))

    def to_polars(self) -> Any:
        """Return the log as a polars data frame, `run` first, then the canonical columns; NaN is missing."""
        from auvnn.logs.data_frames import to_polars

        return to_polars(self)

    def to_pandas(self) -> Any:
        """Return the log as a pandas data frame, `run` first, then the canonical columns; NaN is missing.

        Raises:
            MissingExtra: pandas is not there.
        """
        from auvnn.logs.data_frames import to_pandas

        return to_pandas(self)

    @classmethod
    def from_runs(cls, runs: Iterable[Run], name: str = "log", repairs: Iterable[Repair] = ()) -> Log:
        """Make a log of runs in memory.

        Args:
            runs: in their order, each with a separate number.
            name: of the log.
            repairs: what was corrected on the way here.
        """
        return cls(tuple(runs), name=name, repairs=tuple(repairs))

    @property
    def path(self) -> Path | None:
        """The file the log was read from, the first of several, None for a log made in memory."""
        return self.paths[0] if self.paths else None

    @property
    def samples(self) -> int:
        """Number of samples of all runs."""
        return sum(run.samples for run in self.runs)

    @property
    def duration(self) -> float:
        """Sum of the runs' durations, s."""
        return sum(run.duration for run in self.runs)

    @property
    def kind(self) -> str:
        """What actuates the vehicle: "thrusters" where there are thruster commands, else "wrench"."""
        return self.runs[0].kind

    def drives(self, kind: str) -> bool:
        """Whether every run has commands of a kind, "thrusters" or "wrench"."""
        return all((run.thrusters if kind == "thrusters" else run.wrench) is not None for run in self.runs)

    @property
    def n_thrusters(self) -> int:
        """Number of thruster commands, 0 for a log with a wrench alone."""
        thrusters = self.runs[0].thrusters
        return 0 if thrusters is None else thrusters.shape[1]

    @property
    def columns(self) -> list[str]:
        """Names of the columns with samples, in the order in which they are written, `run` first."""
        names = [name for name, _ in self.runs[0].columns()]
        return ["run", *(n for n in names if any(n in run.channels for run in self.runs))]

    @cached_property
    def _quality(self) -> Quality:
        from auvnn.logs.quality.quality import assess

        return assess(self.measured)

    def quality(self) -> Quality:
        """Return what was read, repaired, implausible and excited; computed once."""
        return self._quality

    @property
    def measured(self) -> Log:
        """The log as it was recorded; itself where nothing was estimated."""
        return self._part([run.measured for run in self.runs]) if self.estimated else self

    @property
    def estimated(self) -> tuple[str, ...]:
        """Channels whose values were estimated and not measured."""
        return tuple(dict.fromkeys(n for run in self.runs for n in run.estimated))

    @cached_property
    def unmeasured(self) -> list[str]:
        """What a model needs of every sample and no run has measured: of attitude, u, v, w, p, q, r."""
        runs = [run.measured for run in self.runs]
        absent = [n for i, n in enumerate(VELOCITY) if all(np.isnan(run.nu[:, i]).all() for run in runs)]
        attitude = all(np.isnan(run.quaternion).any(axis=1).all() for run in runs)
        return (["attitude"] if attitude else []) + absent

    def refuse_unmeasured(self) -> None:
        """Raise where attitude or a velocity was not measured at all.

        Raises:
            InputError: naming what is not there.
        """
        if self.unmeasured:
            raise InputError(
                f"log '{self.name}': {', '.join(self.unmeasured)} not measured, which this needs in some samples: check, "
                "compare, diagnose, add and train (objective=rollout) do without; a mapping can make velocities of "
                "positions (difference: true)"
            )

    def select(self, numbers: int | Iterable[int]) -> Log:
        """Return a log of the runs with these numbers, in this order."""
        wanted = [numbers] if isinstance(numbers, int) else list(numbers)
        by_number = {run.number: run for run in self.runs}
        for number in wanted:
            if number not in by_number:
                raise ConfigError(f"log '{self.name}' has no run {number}; there are: {sorted(by_number)}")
        return self._part([by_number[n] for n in wanted])

    def split(self, test_fraction: float = 0.3) -> tuple[Log, Log, str]:
        """Return what to fit on, what to hold out, and a sentence that says which is which.

        The last run is held out; of a single run the last `test_fraction` of its time.
        """
        run, *others = self.runs
        if others:
            held = others[-1]
            words = f"run {held.number}, the last of '{self.name}', is held out ({held.samples} samples)"
            return self._part(self.runs[:-1]), self._part([held]), words
        if not 0.0 < test_fraction < 1.0:
            raise ConfigError(f"test_fraction must lie between 0 and 1, not {test_fraction}")
        at = int(np.searchsorted(run.t, run.t[0] + (1.0 - test_fraction) * run.duration))
        if min(at, run.samples - at) < MIN_SAMPLES:
            raise InputError(
                f"log '{self.name}': {run.samples} samples cannot be split into two parts of at least "
                f"{MIN_SAMPLES}; name a test log with test="
            )
        words = (
            f"the last {100 * test_fraction:.0f} % of the single run of '{self.name}', "
            f"from t = {run.t[at]:.6g} s, are held out ({run.samples - at} samples)"
        )
        return self._part([run.cut(slice(0, at))]), self._part([run.cut(slice(at, None))]), words

    def write(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write the log with canonical columns as `.parquet`, `.csv` or `.mcap`; reading it back gives the same log.

        In MCAP it is ROS 2: nav_msgs/Odometry in ENU and FLU, everything else by name in a sensor_msgs/JointState.

        Raises:
            InputError: the file is there already and `overwrite` is false.
            ConfigError: the name ends in none of these.
            MissingExtra: a package is missing that writes the format.
        """
        from auvnn.logs.writing import write

        return write(self, Path(path), overwrite)

    def _part(self, runs: Iterable[Run]) -> Log:
        return replace(self, runs=tuple(runs))

    def _content_hash(self) -> str:
        digest = hashlib.sha256()
        for run in self.runs:
            for name, column in run.columns():
                digest.update(name.encode())
                digest.update(np.ascontiguousarray(column).tobytes())
        return digest.hexdigest()


def blocks_of(run: Run) -> frozenset[str]:
    """Return the names of the blocks a run has, thrusters and fins with their number."""
    names = {b for b in ("nu_dot", "position", "wrench", *SCALARS) if getattr(run, b) is not None}
    for block in ("thrusters", "fins"):
        value = getattr(run, block)
        if value is not None:
            names.add(f"{block} ({value.shape[1]})")
    return frozenset(names)
