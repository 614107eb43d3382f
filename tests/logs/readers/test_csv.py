"""CSV in every shape that spreadsheets and loggers write: read the same, or refused with the reason."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log
from tests.log_samples import frame, make_run, same

RUN = make_run(60)
TEXT = frame(RUN).write_csv()


def write(folder: Path, content: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def words(log: Log) -> str:
    return " | ".join(f"{r.what} ({r.count})" for r in log.repairs)


def columns(text: str, separator: str = ",") -> list[list[str]]:
    return [line.split(separator) for line in text.strip().split("\n")]


def join(rows: list[list[str]], separator: str = ",") -> str:
    return "\n".join(separator.join(row) for row in rows) + "\n"


def test_plain_file_reads_back_exactly(tmp_path: Path) -> None:
    log = Log.read(write(tmp_path, TEXT))
    same(log.runs[0], RUN)
    assert log.repairs == ()
    assert log.name == "log"


DIALECTS = {
    "semicolon": (lambda s: s.replace(",", ";"), "separator ';'"),
    "semicolon and decimal comma": (lambda s: s.replace(",", ";").replace(".", ","), "decimal comma"),
    "tab": (lambda s: s.replace(",", "\t"), "separator tab"),
    "byte order mark": (lambda s: "\ufeff" + s, ""),
    "carriage returns": (lambda s: s.replace("\n", "\r\n"), ""),
    "old Mac": (lambda s: s.replace("\n", "\r"), ""),
    "mixed line ends": (lambda s: s.replace("\n", "\r\n", 20), "line ends"),
    "trailing separator": (lambda s: s.replace("\n", ",\n"), ""),
    "trailing separator in rows only": (
        lambda s: s.split("\n", 1)[0] + "\n" + s.split("\n", 1)[1].replace("\n", ",\n"),
        "separator at the end",
    ),
    "comments first": (lambda s: "# my vehicle\n# 2026\n" + s, "comment lines before the header skipped (2)"),
    "Excel's separator line": (lambda s: "sep=,\n" + s, ""),
    "blank lines": (lambda s: s.replace("\n", "\n\n"), ""),
    "no last line feed": (lambda s: s.rstrip("\n"), ""),
    "quoted header": (lambda s: '"' + s.split("\n")[0].replace(",", '","') + '"\n' + s.split("\n", 1)[1], ""),
    "all quoted": (
        lambda s: "\n".join('"' + line.replace(",", '","') + '"' for line in s.strip().split("\n")),
        "",
    ),
    "blanks around cells": (lambda s: s.replace(",", " , "), ""),
    "row index": (
        lambda s: "\n".join(f"{'' if i == 0 else i - 1},{x}" for i, x in enumerate(s.strip().split("\n"))),
        "row index",
    ),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_dialects(name: str, tmp_path: Path) -> None:
    change, note = DIALECTS[name]
    log = Log.read(write(tmp_path, change(TEXT).encode()))
    same(log.runs[0], RUN)
    assert note in words(log)


def test_utf_16_and_latin_1(tmp_path: Path) -> None:
    header, rest = TEXT.split("\n", 1)
    named = header + ",température\n" + "".join(line + ",1\n" for line in rest.strip().split("\n"))
    log = Log.read(write(tmp_path, named.encode("latin-1")))
    assert "Latin-1" in words(log)
    assert list(log.runs[0].extra) == ["température"]
    assert log.unknown == ("température",)
    log = Log.read(write(tmp_path, named.encode("utf-16"), "utf16.csv"))
    assert list(log.runs[0].extra) == ["température"]


def test_unit_line_below_the_header(tmp_path: Path) -> None:
    header, rest = TEXT.split("\n", 1)
    units = ",".join("m/s" for _ in header.split(","))
    log = Log.read(write(tmp_path, f"{header}\n{units}\n{rest}"))
    same(log.runs[0], RUN)
    assert "without a number" in words(log)


def test_repeated_header_lines_are_counted(tmp_path: Path) -> None:
    header, *rows = TEXT.strip().split("\n")
    lines = [header, header, *rows[:20], header, header, *rows[20:], header]
    log = Log.read(write(tmp_path, "\n".join(lines)))
    same(log.runs[0], RUN)
    assert "repeated header lines left out (logs joined into one file?) (4)" in words(log)


@pytest.mark.parametrize("token", ["NaN", "nan", "-", "", "inf", "-Inf", "NA", "null", "N/A", " "])
def test_missing_cells(token: str, tmp_path: Path) -> None:
    rows = columns(TEXT)
    at = rows[0].index("u")
    for i in (5, 9):
        rows[i][at] = token
    log = Log.read(write(tmp_path, join(rows)))
    u = log.runs[0].nu[:, 0]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(u)), [4, 8])
    assert "(2)" in words(log)


@pytest.mark.parametrize("token", ["1e400", "-1e999"])
def test_overflow_is_refused_with_its_line(token: str, tmp_path: Path) -> None:
    rows = columns(TEXT)
    rows[7][rows[0].index("w")] = token
    with pytest.raises(InputError, match=r"column 'w', line 8: the number is too large"):
        Log.read(write(tmp_path, join(rows)))
    rows[3][rows[0].index("u")] = "inf"  # a word for missing elsewhere must not hide it
    with pytest.raises(InputError, match="too large"):
        Log.read(write(tmp_path, join(rows)))


def test_a_rare_unreadable_cell_is_missing_and_named(tmp_path: Path) -> None:
    text = frame(make_run(400)).write_csv()
    rows = columns(text)
    rows[10][rows[0].index("q")] = "0.1.2"
    log = Log.read(write(tmp_path, join(rows)))
    assert np.isnan(log.runs[0].nu[9, 4])
    assert "line 11 says '0.1.2'" in words(log)
    assert next(r for r in log.repairs if "0.1.2" in r.what).level == "warning"


def test_text_in_a_required_column_is_refused(tmp_path: Path) -> None:
    rows = columns(TEXT)
    for row in rows[1:]:
        row[rows[0].index("u")] = "fast"
    with pytest.raises(InputError, match=r"'u' is no column of numbers: line 2 says 'fast'"):
        Log.read(write(tmp_path, join(rows)))


def test_text_elsewhere_is_left_out_and_named(tmp_path: Path) -> None:
    rows = columns(TEXT)
    text = join([[*rows[0], "mode"], *([*r, "auto"] for r in rows[1:])])
    log = Log.read(write(tmp_path, text))
    assert log.runs[0].extra == {}
    assert "'mode' left out" in words(log)


def test_duplicate_columns_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'u' occur twice"):
        Log.read(write(tmp_path, TEXT.replace("voltage", "u", 1)))


def test_a_cut_last_row_is_dropped_and_counted(tmp_path: Path) -> None:
    log = Log.read(write(tmp_path, TEXT[:-60]))
    assert log.samples == 59
    assert "cut short" in words(log)


def test_many_broken_rows_are_refused(tmp_path: Path) -> None:
    rows = columns(TEXT)
    for row in rows[10:30]:
        row.append("1")
    with pytest.raises(InputError, match="20 of 60 rows"):
        Log.read(write(tmp_path, join(rows)))


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "empty"),
        (b"\0" * 200, "zeros only"),
        (bytes(range(256)) * 4, "neither text"),
        (b"t,u\n", "no rows"),
        (b"\n\n\n", "blank"),
        (b"1,2\n3,4\n", "no header line"),
        (b"t u v\n1 2 3\n", "separated by blanks"),
        (b"just words", "separated by blanks"),
        (b"t,u\n" + b"1,2\n" * 500 + b"\0\n", "zero bytes"),
        (b"t,,u\n1,2,3\n", "column 2 has no name"),
        (b't,u\n1,2\n2,"', "quotation mark is opened and not closed"),
        (b't,u\n1,2\n2,"3\n4,5\n6,7\n', "quotation mark is opened and not closed"),
        (b"\x1f\x8b\x08\x00abcdefgh", "gzip"),
        (b"PK\x03\x04" + b"abcdefgh" * 3, "spreadsheet"),
        (b"\x89MCAP0\r\n" + b"\0" * 40, "mcap recording and holds no messages"),
    ],
)
def test_what_is_no_table_is_refused(content: bytes, word: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=word) as caught:
        Log.read(write(tmp_path, content))
    assert "\n" not in str(caught.value)


def test_paths_that_are_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        Log.read(tmp_path / "absent.csv")
    with pytest.raises(InputError, match="is a folder"):
        Log.read(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        Log.read("with\0zero.csv")


def test_parquet_under_a_csv_name_is_detected(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    frame(RUN).write_parquet(path)
    log = Log.read(path)
    same(log.runs[0], RUN)
    assert "the content is parquet" in words(log)
    path = write(tmp_path, TEXT, "log.parquet")
    log = Log.read(path)
    same(log.runs[0], RUN)
    assert "the content is csv" in words(log)


def test_control_characters_in_names(tmp_path: Path) -> None:
    log = Log.read(write(tmp_path, TEXT.replace("voltage", "vol\x07tage", 1)))
    assert list(log.runs[0].extra) == ["vol?tage"]


def test_nanosecond_stamps_keep_their_digits(tmp_path: Path) -> None:
    table = frame(RUN).with_columns(
        pl.Series("t", 1_700_000_000_123_456_789 + 50_000_001 * np.arange(60, dtype=np.int64))
    )
    for name in ("log.csv", "log.parquet"):
        table.write_csv(tmp_path / name) if name.endswith("csv") else table.write_parquet(tmp_path / name)
        t = Log.read(tmp_path / name, {"time": {"unit": "ns"}}).runs[0].t
        np.testing.assert_allclose(np.diff(t), 0.050000001, rtol=1e-9)
