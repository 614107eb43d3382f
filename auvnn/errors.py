"""The errors that auvnn raises: each says what is wrong, where, and how to correct it, in one line."""

from __future__ import annotations

from pathlib import Path

# Characters of a message: what a file holds may be quoted in it, whatever its length.
MOST = 2900


def one_line(text: object, limit: int = 600) -> str:
    """Return a text, or what an error says, as one line for a person."""
    line = " ".join(str(text).split())
    return line if len(line) <= limit else line[: limit - 3] + "..."


class AuvnnError(ValueError):
    """Something in what the user gave cannot be used; the message is one line for a person."""

    def __str__(self) -> str:
        """Return the message, cut short where something very long was given."""
        said = super().__str__()
        return said if len(said) <= MOST else one_line(said, MOST)


class InputError(AuvnnError):
    """A file or a table cannot be read or must not be trusted."""


class ConfigError(AuvnnError):
    """An option is unknown, of the wrong type, out of range, or contradicts another."""


class ModelError(AuvnnError):
    """A vehicle or a saved model is not physical, not complete, or not intact."""


class MissingExtra(AuvnnError):
    """An optional package is missing; the message names the command that installs it."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        """Say which package is missing for what, and how to get it."""
        super().__init__(f"{purpose} needs the package '{package}': pip install 'auvnn[{extra}]'")


def refuse_device(path: Path) -> None:
    """Refuse a place that is a pipe or a device: a file that is moved there would take it away.

    Raises:
        InputError: it is one.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise InputError(f"{path} is a pipe or a device, which no file may replace: name a file")
