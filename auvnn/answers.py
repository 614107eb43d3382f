"""What the verbs answer: plain data first, drawn and written the same way everywhere."""

from __future__ import annotations

import json
import math
import os
import stat
import tempfile
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from auvnn.cards import Card, Shown
from auvnn.catalogue import Catalogue
from auvnn.errors import InputError, one_line, refuse_device

# Names, not imports: an answer stands below the floor that draws it.
DRAWERS = Catalogue(
    "report page",
    {
        "log": "auvnn.report.pages.inputs.log:PAGE",
        "model": "auvnn.report.pages.inputs.model:PAGE",
        "comparisons": "auvnn.report.pages.comparisons:PAGE",
        "quality": "auvnn.report.pages.quality:PAGE",
        "comparison": "auvnn.report.pages.comparison:PAGE",
        "diagnosis": "auvnn.report.pages.diagnosis:PAGE",
        "improvement": "auvnn.report.pages.improvement:PAGE",
        "improve": "auvnn.report.pages.improve:PAGE",
        "adaptation": "auvnn.report.pages.adaptation:PAGE",
        "fleet": "auvnn.report.pages.fleet:PAGE",
        "training": "auvnn.report.pages.training:PAGE",
        "demo": "auvnn.report.pages.demo:PAGE",
        "benchmark": "auvnn.report.pages.benchmark:PAGE",
        "study": "auvnn.report.pages.study:PAGE",
        "uncertainties": "auvnn.report.pages.uncertainties:PAGE",
    },
    "auvnn.report_pages",
)


_BARE = {float, type(None)}
# What a card says last.
PLOTTED = ".plot() draws it, .report('report.html') writes the page, .to_dict() is the JSON answer"


def plain(value: Any) -> Any:
    """Turn numpy and tensors into plain JSON data; NaN and infinity become null."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        if len(value) > 32 and not set(map(type, value)) - _BARE:
            # Traces of thousands of numbers: one look at each is enough.
            return [v if v is None or math.isfinite(v) else None for v in value]
        return [plain(v) for v in value]
    if isinstance(value, (bool, str)) or value is None:
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if hasattr(value, "detach"):
        return plain(value.detach().cpu().numpy())
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    return str(value)


def read_start(path: Path, most: int, folder: str) -> bytes:
    """Return the first bytes of a file that a user named.

    Args:
        path: the file.
        most: how many bytes.
        folder: what to say about a folder in its place.

    Raises:
        InputError: it is not there, is a folder, or cannot be read.
    """
    try:
        kind = path.stat().st_mode
        if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):
            # Opening a pipe would wait for somebody to write.
            raise InputError(f"{path}: is a pipe or a device, not a file; save what it gives as a file")
        with path.open("rb") as stream:
            return stream.read(most)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; check the path") from None
    except IsADirectoryError:
        raise InputError(f"{path}: {folder}") from None
    except (OSError, ValueError) as problem:
        raise InputError(f"{path}: cannot be read ({one_line(problem, 300)})") from None


def write_text(path: Path, text: str) -> Path:
    """Write a file beside its place and move it there, so that a kill never leaves half a file."""
    refuse_device(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            # A file name that is not UTF-8 stands in Python's strings as lone surrogates, which no file can hold.
            stream.write(text.encode("utf-8", "replace").decode("utf-8"))
            stream.flush()
            os.fsync(stream.fileno())
        # mkstemp makes files private; a report is meant to be read by whoever may read its folder.
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return path


class Answer(Shown):
    """Base of everything a verb answers: `to_dict` is the JSON of the public contract."""

    kind: ClassVar[str]

    def card(self) -> Card:
        """Return what the answer says about itself in one line, and what a notebook shows of it."""
        said = {n: getattr(self, n, None) for n in ("model", "name", "log")}
        words = " with ".join(v for v in said.values() if isinstance(v, str) and v)
        return Card(self.kind.capitalize(), words, foot=PLOTTED)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer as plain data, its `schema` first."""
        raise TypeError(f"{type(self).__name__} does not say what it answers")

    def write(self, folder: str | Path, *, report: bool = True) -> Path:
        """Write `<kind>.json`, and with `report` also `report.html` and `figures/`, into a folder."""
        folder = Path(folder)
        path = write_text(folder / f"{self.kind}.json", json.dumps(self.to_dict(), indent=1, allow_nan=False))
        if report:
            DRAWERS.get(self.kind).write(self, folder)
        return path

    def figures(self) -> dict[str, Any]:
        """Return the answer's matplotlib figures by name."""
        return DRAWERS.get(self.kind).figures(self)

    def plot(self) -> Any:
        """Return the one figure that says most, for a notebook."""
        return next(iter(self.figures().values()))

    def report(self, path: str | Path) -> Path:
        """Write the answer as one self-contained HTML file and return its path."""
        return write_text(Path(path), DRAWERS.get(self.kind).page(self))
