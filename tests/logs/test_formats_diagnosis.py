"""A simulated log with a hidden current, written by others' libraries, read back, gives the original's diagnosis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import auvnn
from auvnn.logs import Log
from tests.logs import foreign_formats as foreign

pytestmark = pytest.mark.long
NEEDS = {"mcap": "mcap_ros2", "db3": "rosbags", "bag": "rosbags", "ulog": "pyulog", "tlog": "pymavlink", "imc": "imcpy",
         "matlab-7.3": "h5py", "netcdf": "netCDF4"}  # fmt: skip
QUANTISED = (
    "ulog",
    "tlog",
    "imc",
    "dataflash-as-flown",
)  # floats of four bytes, pulse widths of whole microseconds
FORMATS = {n: (f, w) for n, (f, w, _) in foreign.FORMATS.items()} | {
    "dataflash-as-flown": ("log.BIN", lambda log, path: foreign.binary(log, path, quantised=True))
}
EFFECT = "ocean_current"


@pytest.fixture(scope="module")
def original() -> Log:
    model = auvnn.load("bluerov2_heavy")
    hidden = {EFFECT: {"v_north": 0.2, "v_east": -0.1}}
    made = auvnn.simulate(
        model, "multisine", "realistic", hidden, 3, runs=2, duration=60.0, accelerations=False
    )
    # The formats here carry motion and commands alone.
    runs = [replace(r, nu_dot=None, voltage=None, altitude=None, extra={}) for r in made.log.runs]
    return Log.from_runs(runs)


def diagnosed(log: Log) -> tuple[list[str], dict[str, tuple[float, float]]]:
    found = auvnn.diagnose(auvnn.load("bluerov2_heavy"), log, advice=False)
    answer = found.to_dict()
    best = next(c for c in answer["candidates"] if c["effect"] == EFFECT)
    return answer["missing"], {n: (p["value"], p["std"]) for n, p in best["parameters"].items()}


@pytest.fixture(scope="module")
def expected(original: Log) -> tuple[list[str], dict[str, tuple[float, float]]]:
    return diagnosed(original)


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_name_and_the_same_values(name: str, original: Log, expected: tuple, tmp_path: Path) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    file, writer = FORMATS[name]
    paths = []
    for run in original.runs:
        folder = tmp_path / str(run.number)
        folder.mkdir()
        paths.append(writer(Log.from_runs([run]), folder / file))
    missing, values = diagnosed(Log.read(paths))
    assert missing == expected[0] == [EFFECT]
    for parameter, (value, std) in expected[1].items():
        off = abs(values[parameter][0] - value)
        print(
            f"{name} {parameter}: {value:.6f} +- {std:.6f}, off by {off:.2e}, {off / std:.3f} standard errors"
        )
        assert off <= (0.5 * std if name in QUANTISED else 1e-6)
