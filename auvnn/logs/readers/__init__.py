"""The catalogue of log formats: a new format is one file and one line here."""

from __future__ import annotations

from pathlib import Path

from auvnn.answers import read_start
from auvnn.catalogue import Catalogue
from auvnn.errors import InputError
from auvnn.logs.readers.base import Reader, Table, Text
from auvnn.logs.reading.repairs.repair import Repair

__all__ = ["READERS", "Reader", "Table", "Text", "choose"]

# Formats that are certain by their first bytes come before the one that is any text.
READERS = Catalogue(
    "log format",
    {
        "parquet": "auvnn.logs.readers.parquet:ParquetReader",
        "mcap": "auvnn.logs.readers.mcap:McapReader",
        "rosbag2-sqlite3": "auvnn.logs.readers.ros2_sqlite:Ros2SqliteReader",
        "rosbag1": "auvnn.logs.readers.ros1:Ros1Reader",
        "dataflash": "auvnn.logs.readers.dataflash:DataFlashReader",
        "tlog": "auvnn.logs.readers.tlog:TlogReader",
        "ulog": "auvnn.logs.readers.ulog:UlogReader",
        "imc": "auvnn.logs.readers.imc:ImcReader",
        "matlab": "auvnn.logs.readers.matlab:MatlabReader",
        "hdf5": "auvnn.logs.readers.hdf5:Hdf5Reader",
        "slocum": "auvnn.logs.readers.slocum:SlocumReader",
        "alog": "auvnn.logs.readers.alog:AlogReader",
        "csv": "auvnn.logs.readers.csv:CsvReader",
    },
    "auvnn.readers",
)

_FOREIGN = {
    b"\x1f\x8b": "a gzip archive: unpack it first",
    b"\x28\xb5\x2f\xfd": "a zstd archive: unpack it first",
    b"PK\x03\x04": "a zip archive or a spreadsheet: unpack it, or export the sheet as CSV",
    b"ARROW1": "a Feather file: save it as Parquet",
}


def choose(path: Path) -> tuple[Reader, list[Repair]]:
    """Return the reader for a file, by content first and by name second.

    Raises:
        InputError: the file cannot be opened, is empty, or has no known format.
    """
    head = read_start(path, 4096, "is a folder; name the log file in it, or a list of files")
    if not head:
        raise InputError(f"{path}: is empty (0 bytes); the recording or the copy failed")
    suffix = path.suffix.lower()
    readers: list[Reader] = [READERS.get(name)() for name in READERS.names()]
    fitting = [reader for reader in readers if reader.recognises(head)]
    for reader in fitting:
        if suffix in reader.suffixes:
            return reader, []
    certain = [reader for reader in fitting if reader.name != "csv"]
    for magic, what in _FOREIGN.items():
        if head.startswith(magic) and not certain:
            raise InputError(f"{path}: is {what}")
    if not fitting:
        what = "zeros only" if not head.strip(b"\0") else "neither text nor a known format"
        known = ", ".join(reader.name for reader in readers)
        raise InputError(f"{path}: holds {what}; a log is one of: {known}")
    reader = fitting[0]
    # Any name may hold text; only a name that promises another format is worth a word.
    promised = [other.name for other in readers if suffix in other.suffixes]
    if not promised:
        return reader, []
    what = f"the name says {promised[0]}, the content is {reader.name} and was read as such"
    return reader, [Repair(what, str(path), 1, "warning", "give the file its right name")]
