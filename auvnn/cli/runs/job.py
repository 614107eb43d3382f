"""One run of a verb: its options, what it reads, and where it writes."""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from auvnn.cli.notes import noted
from auvnn.cli.runs.folder import WORK
from auvnn.cli.speech import Speaker
from auvnn.errors import ConfigError, InputError

if TYPE_CHECKING:
    from auvnn.logs import Log
    from auvnn.models import GreyBox


_LARGE = 50_000_000  # bytes of a log from which on reading it takes seconds


class Answering(Protocol):
    """What a verb returns: something that can say itself as plain data."""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        ...


@dataclass(frozen=True)
class Verb:
    """A verb of the command line.

    Attributes:
        summary: one line for the list of verbs.
        reads: options that name a model, a log or another file, in the order in which they are read.
        writes: files and folders that it leaves in `out`.
        run: does it.
        dry_run: refuses, before anything is computed, what `run` would refuse.
    """

    summary: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    run: Callable[[Job], Answering]
    dry_run: Callable[[Job], None] | None = None


@dataclass
class Job:
    """One run of a verb.

    Attributes:
        options: composed and checked.
        out: the folder that the user will find.
        folder: where to write now; it becomes `out` when all is there.
        say: speaks to the user.
        said: what it was warned of.
    """

    options: dict[str, Any]
    out: Path
    folder: Path
    say: Speaker = field(default_factory=Speaker)
    said: set[str] = field(default_factory=set)

    def __getitem__(self, key: str) -> Any:
        """Return an option."""
        return self.options[key]

    def models(self, log: Log) -> dict[str, GreyBox]:
        """Load the model of `model=`, or each of a list, by what it was called on the command line."""
        return {str(source): self.model(log, source=str(source)) for source in self.names("model")}

    def model(self, log: Log | None = None, kinds: Sequence[str] = (), source: str | None = None) -> GreyBox:
        """Load the model of `model=`, driven by what the log has, thruster commands or a wrench.

        A log that has both drives the model by what the model was saved with.

        Args:
            log: the log.
            kinds: what commands it has, where it is not in memory, that which is taken by default first.
            source: one of several models.

        Raises:
            ConfigError: there is a list of models where one is needed.
        """
        from auvnn.models import load

        if source is None and isinstance(self["model"], list):
            raise ConfigError(f"model={self['model']}: one model is needed; only compare takes a list")
        called = str(self["model"] if source is None else source)
        source = os.path.expanduser(called)
        model = load(source)
        if log is not None:
            kinds = (log.kind, *(k for k in ("thrusters", "wrench") if log.drives(k) and k != log.kind))
        if kinds and model.actuation not in kinds:
            model = load(source, actuation=kinds[0])
        source = called
        effects = ", ".join(model.effect_names) or "none"
        learned = "none" if model.damping is None else "six subnetworks"
        name = source if source == model.vehicle.name else f"{source}: {model.vehicle.name}"
        self.say(f"model     {name}; effects: {effects}; learned damping: {learned}")
        for warning in model.vehicle.warnings:
            self._once("assumed", warning)
        return model

    def log(self, key: str = "log", *, repairs: bool = True, partial: bool = False) -> Log:
        """Read the log of `log=`, or of another option, and say what was corrected in it.

        Args:
            key: the option.
            repairs: whether to say what was corrected.
            partial: whether it may lack attitude or velocities altogether.
        """
        from auvnn.logs import Log

        paths = files(self.options, key)
        for path in paths:
            if path.stat().st_size > _LARGE:
                self.say.progress(f"reading {path}, {path.stat().st_size / 1e6:.0f} MB")
        log = Log.read(
            paths if len(paths) > 1 else paths[0],
            self.mapping(),
            max_duration=self.options.get("max_duration"),
        )
        runs = "1 run" if len(log.runs) == 1 else f"{len(log.runs)} runs"
        names = ", ".join(map(str, paths[:5])) + (f" and {len(paths) - 5} more" if len(paths) > 5 else "")
        extent = f"{runs}, {log.samples} samples over {log.duration:.4g} s, driven by {log.kind}"
        self.say(f"{key:<9} {names}: {extent}")
        if "force" in self.options:  # whoever fits refuses what `check` calls an error
            log.quality().refuse_errors(bool(self["force"]))
        for level, words in noted(log.repairs) if repairs else ():
            self.say(f"{level:<9} {words}", style="yellow" if level != "info" else None)
        if not partial:
            log.refuse_unmeasured()
        return log

    def mapping(self) -> Path | None:
        """Return the path of `mapping=`, if one is named."""
        given = self.options.get("mapping")
        return given and Path(given).expanduser()

    def held_out(self, *, partial: bool = False) -> Log | None:
        """Read the log of `test=`, if one is named; `partial` as for `log`."""
        return None if self.options.get("test") is None else self.log("test", partial=partial)

    def warn(self, warnings: list[str]) -> None:
        """Say what the answer warns of, unless it has been said before."""
        for warning in warnings:
            self._once("warning", warning)

    def _once(self, kind: str, words: str) -> None:
        if words not in self.said:
            self.say(f"{kind:<9} {words}", style="yellow")
        self.said.add(words)

    @property
    def checkpoint(self) -> Path:
        """Where an interrupted training can be taken up again."""
        return self.out / WORK / "checkpoint"

    def names(self, key: str) -> list[str]:
        """Return an option that takes one name or a list.

        Raises:
            ConfigError: it holds something else, or a name twice.
        """
        value = self[key]
        names = value if isinstance(value, list) else [value]
        if not names or not all(isinstance(name, str) and name for name in names):
            raise ConfigError(f"{key}={value}: a name is needed, or a list of names, [this,that]")
        if len(set(names)) < len(names):
            raise ConfigError(f"{key}={value}: a name stands there twice; give it once")
        return names


def files(options: dict[str, Any], key: str) -> list[Path]:
    """Return the paths that an option names, relative to where the user stands.

    In the place of logs there may be a folder of them, or a pattern.

    Raises:
        ConfigError: it names no path.
        InputError: there is no such file.
    """
    value = options[key]
    values = value if isinstance(value, list) else [value]
    if not values or not all(isinstance(v, (str, int, float)) and str(v) for v in values):
        raise ConfigError(f"{key}={value}: a path is needed, or a list of paths")
    paths = [Path(str(v)).expanduser() for v in values]
    if key in ("log", "test") and any(p.is_dir() or set(str(p)) & set("*?[") for p in paths):
        from auvnn.logs.reading.portions import log_files

        paths = log_files(paths)
    for path in paths:
        if not path.exists():
            near = _near(path)
            raise InputError(f"{key}={path}: there is no such file{near}")
    return paths


def _near(path: Path) -> str:
    try:
        there = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return f"; there is no folder {path.parent}"
    lower = {name.lower(): name for name in there}
    near = difflib.get_close_matches(path.name.lower(), list(lower), n=1, cutoff=0.75)
    return f". Did you mean '{path.parent / lower[near[0]]}'?" if near else "; check the path"
