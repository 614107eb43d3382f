"""A model by its name or file and a log by its file, wherever a call takes a model or a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from auvnn.errors import ConfigError
from auvnn.logs import Log
from auvnn.models.grey_box import GreyBox
from auvnn.models.loading import from_vehicle, load
from auvnn.vehicle import Vehicle

# What the calls of the public interface take.
GivenModel = GreyBox | Vehicle | str | Path
GivenLog = Log | str | Path | Sequence[str | Path] | Mapping[str, Any]


def as_log(log: Any, name: str = "log") -> Log:
    """Return a log as it is, or read it: a path, a list of paths, a data frame, a dict of arrays, or a simulation.

    Args:
        log: what was given.
        name: of the argument, for messages.

    Raises:
        ConfigError: it is none of these.
        InputError: it cannot be read.
    """
    if isinstance(log, Log):
        return log
    if isinstance(log, (str, Path)):
        return Log.read(log)
    if isinstance(log, (list, tuple)) and log and all(isinstance(p, (str, Path)) for p in log):
        return Log.read(list(log))
    if isinstance(log, Mapping) or hasattr(log, "columns"):
        return Log.from_dataframe(log)
    made = getattr(log, "log", None)
    if isinstance(made, Log):
        return made
    raise ConfigError(
        f"{name} is {_a(log)}: give a Log, the path of a file, a data frame, or a dict of columns; arrays become a log "
        "by auvnn.Log.from_dataframe({'t': t, 'u': u, ...})"
    )


def as_model(model: Any, log: Log | None = None) -> GreyBox:
    """Return a model as it is, or load it: a built-in name, a YAML file, a saved folder, or a `Vehicle`.

    Args:
        model: what was given.
        log: by what the log has, thruster commands or a wrench, a model is driven that is loaded here.

    Raises:
        ConfigError: it is none of these, or an unknown name.
        ModelError: the file is damaged or not physical.
    """
    if isinstance(model, GreyBox):
        return model
    if isinstance(model, Vehicle):
        made = from_vehicle(model)
        return made if log is None or log.drives(made.actuation) else from_vehicle(model, log.kind)
    if isinstance(model, (str, Path)):
        source = Path(model).expanduser() if str(model).startswith("~") else model
        made = load(source)
        return made if log is None or log.drives(made.actuation) else load(source, log.kind)
    raise ConfigError(
        f"model is {_a(model)}: give a model (auvnn.load), the name of a built-in vehicle, a path, or a Vehicle"
    )


def _a(value: Any) -> str:
    kind = type(value)
    return (
        kind.__name__ if kind.__module__ == "builtins" else f"{kind.__module__.split('.')[0]}.{kind.__name__}"
    )
