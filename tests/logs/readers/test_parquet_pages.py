"""Counts and checksums of Parquet files are compared before a decoder believes them."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from auvnn.errors import InputError
from auvnn.logs.readers.parquet_pages import check
from auvnn.logs.readers.thrift import Cursor, ThriftError
from tests.log_samples import frame, make_run

TABLE = pl.DataFrame(
    {
        "a": np.random.default_rng(0).normal(size=3000),
        "b": np.arange(3000) // 100,
        "s": ["x", "y", None] * 1000,
        "lists": [[1, 2]] * 3000,
        "records": [{"p": 1, "q": "z"}] * 3000,
        "flag": [True, None, False] * 1000,
    }
)


@pytest.mark.parametrize("compression", ["uncompressed", "snappy", "gzip", "zstd", "brotli", "lz4"])
@pytest.mark.parametrize("group", [None, 700])
def test_good_files_of_polars_pass(compression: str, group: int | None, tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    TABLE.write_parquet(path, compression=compression, row_group_size=group)  # type: ignore[arg-type]
    contents = check(path)
    assert contents.rows == 3000
    assert contents.flat == ["a", "b", "s", "flag"]
    assert contents.nested == ["lists", "records"]


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_good_files_of_arrow_pass_and_checksums_are_verified(version: str, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow writes the checksums to verify")
    path = tmp_path / "a.parquet"
    parquet.write_table(
        TABLE.to_arrow(), path, data_page_version=version, write_page_checksum=True, data_page_size=3000
    )
    assert check(path).rows == 3000
    damaged = bytearray(path.read_bytes())
    damaged[9000] ^= 4
    path.write_bytes(damaged)
    with pytest.raises(InputError, match="checksum is wrong"):
        check(path)


def test_every_single_byte_of_the_footer_may_be_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    frame(make_run(40)).select("t", "u").write_parquet(path, compression="uncompressed")
    whole = path.read_bytes()
    footer = int.from_bytes(whole[-8:-4], "little")
    refused = 0
    for i in range(len(whole) - 8 - footer, len(whole) - 8):
        damaged = bytearray(whole)
        damaged[i] ^= 0x55
        path.write_bytes(damaged)
        try:
            check(path)
        except InputError as problem:
            assert "\n" not in str(problem)
            refused += 1
    assert refused > 50


def test_thrift_reads_what_the_specification_shows() -> None:
    # field 1: i32 = 1 (zigzag 2); field 2: list of two i64, -1 and 150; field 3: true; field 20: "hi"
    data = bytes([0x15, 0x02, 0x19, 0x26, 0x01, 0xAC, 0x02, 0x11, 0x08, 0x28, 0x02]) + b"hi" + b"\0"
    assert Cursor(data, 0, len(data)).struct() == {1: 1, 2: [-1, 150], 3: True, 20: b"hi"}
    nested = bytes([0x1C, 0x15, 0x04, 0x00, 0x1B, 0x01, 0x85, 0x01]) + b"k" + bytes([0x06, 0x00])
    assert Cursor(nested, 0, len(nested)).struct() == {1: {1: 2}, 2: [(b"k", 3)]}


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x15",
        b"\x15" + b"\xff" * 12,
        b"\x18\x7fab",
        b"\x19\xf5\xff\xff\x7f",
        b"\x1c" * 60,
        b"\x1e\0",
        b"\x1d\0",
    ],
)
def test_damaged_thrift_is_refused(data: bytes) -> None:
    with pytest.raises(ThriftError):
        Cursor(data, 0, len(data)).struct()
