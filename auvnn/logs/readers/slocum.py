"""Slocum gliders' binary logs (`.dbd`, `.ebd` and their like), by dbdreader where the user has installed it.

dbdreader (Merckelbach, GPL-3) is not among auvnn's own packages; it needs the lists of sensors that the file names by a
checksum (`cac/`), which are looked for beside the file. It is C code: it runs in a process of its own.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

from auvnn.errors import InputError
from auvnn.logs.readers.isolated import run_isolated
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.recording import Recording, Topic, Wanted

_MEMORY, _SECONDS = 1_000_000_000, 120.0


class SlocumReader(RecordingReader):
    """Sensors of a glider, each at its own times."""

    name = "slocum"
    suffixes = (".dbd", ".ebd", ".sbd", ".tbd", ".mbd", ".nbd", ".dcd", ".ecd")

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts with a glider's header."""
        return head.startswith(b"dbd_label:")

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read the sensors that are wanted."""
        if importlib.util.find_spec("dbdreader") is None:
            raise InputError(
                f"{path}: is a Slocum glider's file; reading it needs dbdreader (GPL-3): pip install dbdreader"
            )
        places = [
            p for p in (path.parent / "cac", path.parent / "CAC", path.parent.parent / "cac") if p.is_dir()
        ]
        lists = str(places[0]) if places else str(path.parent)
        arrays = run_isolated("slocum_worker.py", [str(path), lists], str(path), _MEMORY, _SECONDS)
        names = sorted({n.rsplit("|", 1)[0] for n in arrays})
        times = {n: arrays[f"{n}|t"] for n in names}
        begin = min((float(np.nanmin(t)) for t in times.values() if len(t)), default=0.0)
        topics = {}
        for name in names:
            if len(times[name]) and (wanted is None or wanted(name, "slocum")):
                topics[name] = Topic(name, "slocum", times[name] - begin, {"value": arrays[f"{name}|v"]})
        if not topics and wanted is None:
            raise InputError(f"{path}: holds no sensor's values")
        return Recording(topics)
