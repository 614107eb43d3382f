"""Rows 1 to 25: files that are absent, foreign, damaged, oddly written or too large."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.readers.csv import CsvReader
from tests.log_samples import frame, make_run, same

RUN = make_run(400, noise=0.01)


def joined(rows: list[list[str]], separator: str = ",") -> str:
    return "\n".join(separator.join(row) for row in rows) + "\n"


def uncompressed(path: Path) -> bytes:
    """A Parquet file of another program, without compression, statistics or checksums."""
    parquet.write_table(
        frame(RUN).to_arrow(), path, compression="NONE", use_dictionary=False, write_statistics=False
    )
    return path.read_bytes()


def test_row_01_a_path_that_is_no_file(refused, monkeypatch):
    assert "'good.csv'" in refused("check", "log=god.csv")
    Path("folder").mkdir()
    assert "is a folder" in refused("check", "log=folder")
    opened = Path.open

    def locked(self: Path, *arguments: Any, **options: Any) -> Any:
        if self.name == "good.csv":
            raise PermissionError(13, "Permission denied")
        return opened(self, *arguments, **options)

    monkeypatch.setattr(Path, "open", locked)
    assert "good.csv: cannot be read" in refused("check", "log=good.csv")


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("empty.csv", ["check", "log=empty.csv"], "is empty (0 bytes)"),
        ("empty.parquet", ["check", "log=empty.parquet"], "is empty (0 bytes)"),
        ("empty.yaml", ["check", "log=good.csv", "mapping=empty.yaml"], "is empty; it must hold"),
        ("empty.yaml", ["compare", "log=good.csv", "model=empty.yaml"], "is empty; it must hold"),
    ],
)
def test_row_02_an_empty_file_of_every_format(refused, name, arguments, words):
    Path(name).touch()
    line = refused(*arguments)
    assert name in line and words in line


def test_row_03_a_name_that_promises_another_format(refused, noted, good):
    Path("good.csv").rename("log.parquet")
    assert "warning: log.parquet: the name says parquet, the content is csv" in noted("log.parquet")
    Path("dive.csv").write_bytes(b"\x89MCAP0\r\n" + bytes(60))
    assert "is a mcap recording and holds no messages" in refused("check", "log=dive.csv")


@pytest.mark.parametrize("name", ["noise.csv", "noise.parquet"])
def test_row_04_zeros_and_noise(refused, name):
    Path(name).write_bytes(bytes(5000))
    assert "holds zeros only" in refused("check", f"log={name}")
    noise = np.random.default_rng(0).integers(0, 256, 5000, dtype=np.uint8).tobytes()
    Path(name).write_bytes(noise)
    assert "neither text nor a known format" in refused("check", f"log={name}")
    Path(name).write_bytes(b"PAR1" + noise + b"PAR1")
    assert "damaged Parquet file" in refused("check", f"log={name}")


def test_row_05_a_file_that_ends_in_the_middle(refused, noted, good):
    """The whole rows of a CSV file are kept; a Parquet file has its table of contents at its end."""
    lines = good.split("\n")
    Path("cut.csv").write_text("\n".join(lines[:300])[:-20])
    found = noted("cut.csv")
    assert re.search(
        r"warning: cut\.csv: rows with the wrong number .*0\.33 % .*the last row is cut short", found
    )
    same(Log.read("cut.csv").runs[0], make_run(400, noise=0.01).cut(slice(0, 298)))
    Path("cut.csv").write_text("\n".join(lines[:300])[:-1])
    assert "the last row has no line end: complete, unless the copy was cut" in noted("cut.csv")
    whole = uncompressed(Path("whole.parquet"))
    Path("cut.parquet").write_bytes(whole[: len(whole) // 2])
    assert "is cut short: the table of contents at its end is missing" in refused("check", "log=cut.parquet")


def test_row_06_nothing_but_the_beginning_of_a_header(refused, good):
    for content in (good[:10], good.split("\n")[0], good.split("\n")[0] + "\n"):
        Path("cut.csv").write_text(content)
        assert "cut.csv: has a header line but no rows" in refused("check", "log=cut.csv")
    Path("cut.parquet").write_bytes(b"PAR1\x15\x04")
    assert "is cut short" in refused("check", "log=cut.parquet")


def test_row_07_one_flipped_bit_in_a_parquet_file(refused, noted):
    """Our own files carry a hash; of others without checksums, a number that no vehicle reaches is left out."""
    path = Log.from_runs([RUN]).write("own.parquet")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)
    assert re.search("damaged|wrong", refused("check", "log=own.parquet"))
    foreign = Path("foreign.parquet")
    data = bytearray(uncompressed(foreign))
    at = data.index(np.float64(RUN.nu[100, 0]).tobytes())
    data[at + 7] ^= 0x40  # the highest bit of the exponent
    foreign.write_bytes(data)
    found = noted(foreign, level="warning")
    assert (
        "foreign.parquet: values of 'nu' beyond 1e+03, which no vehicle reaches, read as missing (1)" in found
    )
    assert np.flatnonzero(np.isnan(Log.read(foreign).runs[0].nu[:, 0])).tolist() == [100]
    whole = frame(RUN).to_arrow()
    parquet.write_table(whole, foreign, compression="NONE", write_page_checksum=True, use_dictionary=False)
    data = bytearray(foreign.read_bytes())
    data[data.index(np.float64(RUN.nu[100, 0]).tobytes())] ^= 1
    foreign.write_bytes(data)
    assert "a page's checksum is wrong" in refused("check", "log=foreign.parquet")


@pytest.mark.parametrize(("number", "name"), [(3, "LZO"), (8, "method 8")])
def test_row_14_a_compression_that_cannot_be_unpacked(refused, number, name):
    data = uncompressed(Path("log.parquet"))
    column = b"\x19\x18\x01u\x15"  # the path of the column u in its description; its codec follows
    assert data.count(column + b"\0") == 1
    Path("log.parquet").write_bytes(data.replace(column + b"\0", column + bytes([2 * number])))
    line = refused("check", "log=log.parquet")
    assert f"column 'u' is compressed by {name}" in line and "save the file with zstd or snappy" in line


@pytest.mark.parametrize("codec", ["snappy", "gzip", "brotli", "zstd", "lz4"])
def test_row_14_every_usual_compression_is_read(codec):
    parquet.write_table(frame(RUN).to_arrow(), "log.parquet", compression=codec)
    same(Log.read("log.parquet").runs[0], RUN)


WRITTEN = {
    "semicolons": (lambda s: s.replace(",", ";"), "info: log.csv: read with separator ';'"),
    "decimal comma": (lambda s: s.replace(",", ";").replace(".", ","), "separator ';', decimal comma"),
    "byte order mark": (lambda s: "\ufeff" + s, "byte order mark at the start left out"),
    "trailing separators": (lambda s: s.replace("\n", ",\n"), "separator at the end of the header ignored"),
    "repeated header": (
        lambda s: s.replace("\n", "\n" + s.split("\n")[0] + "\n", 3),
        "repair: log.csv: repeated header lines left out (logs joined into one file?) (3)",
    ),
    "mixed line ends": (lambda s: s.replace("\n", "\r\n", 9), "line ends of different kinds made one (9)"),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_row_19_every_way_of_writing_csv_is_read_and_said(noted, good, name):
    change, words = WRITTEN[name]
    Path("log.csv").write_bytes(change(good).encode())
    assert words in noted("log.csv")
    same(Log.read("log.csv").runs[0], RUN)


def test_row_19_what_is_latin_1_is_said_and_what_is_ambiguous_is_refused(noted, refused, good, rows):
    Path("log.csv").write_bytes(good.replace("voltage", "Spannung_übrig").encode("latin-1"))
    assert "not UTF-8: read as Latin-1" in noted("log.csv")
    Path("log.csv").write_text(joined([rows[0], *([c.replace(".", ",") for c in row] for row in rows[1:])]))
    assert "is the separator ',' also used inside the cells?" in refused("check", "log=log.csv")


def test_row_20_cells_that_hold_no_number_are_missing_and_those_too_large_refused(noted, refused, rows):
    u = rows[0].index("u")
    for i, cell in enumerate(["NaN", "inf", "-", "", "-inf", "n/a"]):
        rows[10 * i + 10][u] = cell
    Path("log.csv").write_text(joined(rows))
    found = noted("log.csv")
    assert "(empty, NaN, infinite) read as missing (6)" in found and "samples missing: u 1.5 %" in found
    assert np.flatnonzero(np.isnan(Log.read("log.csv").runs[0].nu[:, 0])).tolist() == [9, 19, 29, 39, 49, 59]
    rows[7][u] = "1e400"
    Path("log.csv").write_text(joined(rows))
    assert "column 'u', line 8: the number is too large for a float64" in refused("check", "log=log.csv")


def test_row_21_column_names(refused, noted, good, rows):
    Path("log.csv").write_text(good.replace("voltage", "u", 1))
    assert "the columns 'u' occur twice; rename one of each" in refused("check", "log=log.csv")
    table = frame(RUN).to_arrow()
    parquet.write_table(
        table.rename_columns([n.replace("voltage", "u") for n in table.column_names]), "log.parquet"
    )
    assert "the columns 'u' occur twice; rename one of each" in refused("check", "log=log.parquet")
    parquet.write_table(
        table.rename_columns([n.replace("voltage", "") for n in table.column_names]), "log.parquet"
    )
    assert "warning: log.parquet: column without a name left out" in noted("log.parquet")
    Path("log.csv").write_text(joined([["" if c == "v" else c for c in rows[0]], *rows[1:]]))
    assert "has no name; name it in the header line" in refused("check", "log=log.csv")
    named = {"t": "time [ms]", "u": "surge (m/s)", "r": "yaw_rate_deg/s"}
    Path("log.csv").write_text(joined([[named.get(c, c) for c in rows[0]], *rows[1:]]))
    line = refused("check", "log=log.csv")
    assert "columns t, u, r missing" in line
    assert "{t: {from: 'time [ms]'}, u: {from: 'surge (m/s)'}, r: {from: yaw_rate_deg/s}}" in line
    assert "rates: deg" in line and "time: {unit: ms}" in line


def test_row_22_a_log_larger_than_the_memory(refused, noted, monkeypatch, good):
    """It is refused before it is read; its beginning can be read in as much memory as that takes."""
    monkeypatch.setattr("auvnn.logs.reading.head._FIRST", 4000)
    with Path("long.csv").open("w") as stream:
        header, *lines = good.strip().split("\n")
        stream.write(header + "\n")
        for i in range(20):  # four hundred seconds of the same
            for k, line in enumerate(lines):
                stream.write(f"{0.05 * (400 * i + k):.6g},{line.split(',', 1)[1]}\n")
    size = Path("long.csv").stat().st_size
    monkeypatch.setattr("auvnn.logs.readers.memory.available_bytes", lambda: size)
    line = refused("check", "log=long.csv")
    assert "GB of memory" in line and "max_duration=" in line
    taken = []
    original = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda self: taken.append(self) or original(self))
    log = Log.read("long.csv", max_duration=15.0)
    assert taken == [], "the whole file was read"
    assert log.samples == 301 and log.duration == pytest.approx(15.0)
    assert "the first 15 s read, about 3.8 % of the file" in noted("long.csv", max_duration=15.0)


@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_row_22_the_beginning_is_that_of_the_whole(name, monkeypatch):
    t = RUN.t + np.where(np.arange(400) >= 100, 60.0, 0.0)  # a minute's pause does not count
    table = frame(make_run(400, noise=0.01, t=t))
    (table.write_csv if name.endswith("csv") else table.write_parquet)(name)
    monkeypatch.setattr("auvnn.logs.reading.head._FIRST", 3000)
    same(Log.read(name, max_duration=10.0).runs[0], Log.read(name).runs[0].cut(slice(0, 202)))
    same(Log.read(name, max_duration=1e4).runs[0], Log.read(name).runs[0])


def test_row_22_the_command_line_takes_a_duration(refused, monkeypatch):
    asked = []

    def tell(*arguments: Any, **options: Any) -> Log:
        asked.append(options["max_duration"])
        raise InputError("seen")

    assert "above zero" in refused("check", "log=good.csv", "max_duration=-1")
    assert "above zero" in refused("check", "log=good.csv", "max_duration=long")
    monkeypatch.setattr(Log, "read", tell)
    for verb in ("check", "compare", "diagnose", "add", "train"):
        more = {"check": []}.get(verb, ["model=rov95"]) + ["effect=ocean_current"] * (verb == "add")
        assert "seen" in refused(verb, "log=good.csv", "max_duration=12", *more)
    assert asked == [12] * 5


def test_row_23_a_file_that_changes_or_goes_while_it_is_read(refused, monkeypatch):
    original = CsvReader.read

    def meanwhile(what: Any) -> Any:
        def read(self: CsvReader, path: Path) -> Any:
            table = original(self, path)
            what(path)
            return table

        return read

    def append(path: Path) -> None:
        with path.open("a") as stream:
            stream.write("1\n")

    before = set(os.listdir())
    monkeypatch.setattr(CsvReader, "read", meanwhile(append))
    assert "changed while it was read; wait until" in refused("check", "log=good.csv", "out=out")
    monkeypatch.setattr(CsvReader, "read", meanwhile(Path.unlink))
    assert "disappeared while it was read" in refused("check", "log=good.csv", "out=out")
    assert set(os.listdir()) == before - {"good.csv"}, "nothing half is kept"


def test_row_24_names_that_are_no_words(auvnn, good, rows):
    """Spaces, slashes, control characters and HTML in names: nothing is written elsewhere, nothing is run."""
    hostile = ["<script>alert(1)</script>", "../../x", "a b/c$HOME", "bell\x07"]
    table = [[*row, "1", "2", "3", "4"] for row in rows]
    table[0][-4:] = hostile
    name = "a <b> $(x) ü.csv"
    Path(name).write_text(joined(table))
    before = set(os.listdir())
    status, out, err = auvnn("check", f"log='{name}'", "out=out")
    assert (status, err) == (0, "")
    assert set(os.listdir()) == {*before, "out"}
    assert {p.name for p in Path("out").iterdir()} == {".hydra", "figures", "quality.json", "report.html"}
    assert all(re.fullmatch(r"[\w.-]+", p.name) for p in Path("out/figures").iterdir())
    assert json.loads(Path("out/quality.json").read_text())["read"]["unknown_columns"] == [
        *hostile[:3],
        "bell?",
    ]
    page = Path("out/report.html").read_text()
    assert "<script" not in page and "&lt;script&gt;" in page and "\x07" not in page + out
    Path("latin.csv").write_bytes(joined(table).encode().replace(b"a b/c$HOME", b"Temp\xe9ratur"))
    assert "Températur" in Log.read("latin.csv").unknown
