"""HDF5, and what is HDF5 inside: MATLAB's v7.3 and NetCDF4. The library is C: it runs in a process of its own."""

from __future__ import annotations

from pathlib import Path

from auvnn.logs.readers.arrays import to_recording
from auvnn.logs.readers.isolated import run_isolated
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.recording import Recording, Wanted

_BASE, _TIMES_SIZE = 700_000_000, 6
_SECONDS = 9.0
_SLOWEST = 20e6  # bytes/s


class Hdf5Reader(RecordingReader):
    """Arrays of an HDF5 file; fill values count as missing, scale and offset of NetCDF are applied."""

    name = "hdf5"
    suffixes = (".h5", ".hdf5", ".hdf", ".nc", ".nc4", ".mat")

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts as HDF5 does, at once or behind MATLAB's 512 bytes."""
        return head.startswith(b"\x89HDF\r\n\x1a\n") or head[512:520] == b"\x89HDF\r\n\x1a\n"

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read all arrays of numbers."""
        size = path.stat().st_size
        memory, seconds = _BASE + _TIMES_SIZE * size, _SECONDS + size / _SLOWEST
        arrays = run_isolated("hdf5_worker.py", [str(path)], str(path), memory, seconds)
        return to_recording(arrays, str(path), [])
