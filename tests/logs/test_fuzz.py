"""Whatever the bytes, reading gives a log or one line that says why not."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from auvnn.errors import AuvnnError
from auvnn.logs import Log
from tests.log_samples import frame, make_run

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
RUN = make_run(40)
MAPPING = (
    "columns:\n  u: {from: u, scale: 1.0, offset: 0.0}\n"
    "  thruster_1: {from: thruster_1, curve: {neutral: 0.0, span: 1.0}}\n"
    "frame: {body: FRD, world: NED}\nangles: rad\nquaternion: wxyz\ntime: {unit: s}\n"
)
edits = st.lists(
    st.tuples(
        st.sampled_from(["set", "insert", "delete", "cut", "repeat"]),
        st.integers(0, 10**6),
        st.binary(min_size=1, max_size=4),
    ),
    min_size=1,
    max_size=8,
)
cells = st.one_of(
    st.sampled_from(
        ["", "-", "nan", "1e400", "-0", "1e-400", "0x1", "1_0", '"', "a,b", "\x00", "é", "1;2", "inf"]
    ),
    st.floats().map(repr),
    st.integers().map(str),
    st.text(max_size=5),
)
LIMITS = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def mutate(content: bytes, changes: list[tuple[str, int, bytes]]) -> bytes:
    data = bytearray(content)
    for kind, place, new in changes:
        i = place % (len(data) + 1)
        if kind == "set":
            data[i : i + len(new)] = new
        elif kind == "insert":
            data[i:i] = new
        elif kind == "delete":
            del data[i : i + 7]
        elif kind == "cut" and place % 5 == 0:
            del data[i:]
        else:
            data[i:i] = data[i : i + 60]
    return bytes(data)


def read(path: Path, content: bytes, mapping: Path | None = None) -> None:
    path.write_bytes(content)
    try:
        log = Log.read(path, mapping)
    except AuvnnError as problem:
        assert "\n" not in str(problem)
        assert len(str(problem)) < 3000
        return
    assert log.samples >= 3
    log.quality().to_dict()


@given(edits)
@LIMITS
def test_mutated_csv(tmp_path: Path, changes: list) -> None:
    read(tmp_path / "log.csv", mutate(frame(RUN).write_csv().encode(), changes))


@given(st.lists(st.lists(cells, max_size=6), min_size=1, max_size=6))
@LIMITS
def test_any_text_table(tmp_path: Path, rows: list[list[str]]) -> None:
    read(tmp_path / "log.csv", "\n".join(",".join(row) for row in rows).encode("utf-8", "surrogatepass"))


@given(st.lists(st.tuples(st.integers(0, 39), st.integers(0, 18), cells), min_size=1, max_size=8))
@LIMITS
def test_any_cells_in_a_good_table(tmp_path: Path, changes: list[tuple[int, int, str]]) -> None:
    rows = [line.split(",") for line in frame(RUN).write_csv().strip().split("\n")]
    for i, j, cell in changes:
        rows[i + 1][j % len(rows[0])] = cell
    read(tmp_path / "log.csv", "\n".join(",".join(row) for row in rows).encode("utf-8", "surrogatepass"))


@given(edits)
@LIMITS
def test_mutated_parquet(tmp_path: Path, changes: list) -> None:
    source = tmp_path / "source.parquet"
    frame(RUN).write_parquet(source)
    read(tmp_path / "log.parquet", mutate(source.read_bytes(), changes))


@given(edits)
@LIMITS
def test_mutated_mapping(tmp_path: Path, changes: list) -> None:
    path = tmp_path / "map.yaml"
    path.write_bytes(mutate(MAPPING.encode(), changes))
    read(tmp_path / "log.csv", frame(RUN).write_csv().encode(), path)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 11, 12, 100])
@pytest.mark.parametrize("name", ["log.csv", "log.parquet", "log"])
def test_short_beginnings_of_any_file(tmp_path: Path, size: int, name: str) -> None:
    source = tmp_path / "source.parquet"
    frame(RUN).write_parquet(source)
    for content in (source.read_bytes(), frame(RUN).write_csv().encode(), b"\xff\xfe" + b"a" * 100):
        read(tmp_path / name, content[:size])
