"""The measured Beluga logs: what is wrong with them is found without being told."""

import os
from pathlib import Path

import pytest

from auvnn.logs import Log, leakage

_PARENT = Path(__file__).resolve().parents[3]
FOLDER = Path(os.environ.get("AUVNN_DATA", _PARENT / "shared" / "data")) / "beluga"
pytestmark = pytest.mark.skipif(
    not (FOLDER / "surge-1.csv").is_file(),
    reason=f"the Beluga data are not in {FOLDER}; set AUVNN_DATA to the folder that holds beluga/",
)

NAMES = ("surge-1", "sway-1", "heave-1", "yaw-1", "random-1", "random-2")
COLUMNS = {
    "t": "Time",
    **{a: f"linear_{b}" for a, b in zip("uvw", "xyz", strict=True)},
    **{a: f"angular_{b}" for a, b in zip("pqr", "xyz", strict=True)},
    **{f"q{a}": f"orientation_{a}" for a in "wxyz"},
    **{a: f"position_{a}" for a in "xyz"},
    **{f"tau_{a}": f"force.{b}" for a, b in zip("XYZ", "xyz", strict=True)},
    **{f"tau_{a}": f"torque.{b}" for a, b in zip("KMN", "xyz", strict=True)},
    **{
        f"thruster_{i + 1}": {
            "from": f"pwm_{i}" if i else "positive_width_us_0",
            "curve": {"neutral": 1580, "span": 400},
        }
        for i in range(8)
    },
}


def read(names: tuple[str, ...] = NAMES, **columns: object) -> Log:
    return Log.read([FOLDER / f"{n}.csv" for n in names], {"columns": COLUMNS | columns})


@pytest.fixture(scope="module")
def raw() -> Log:
    return read()


def test_every_row_is_read(raw: Log) -> None:
    assert len(raw.runs) == 6
    assert raw.samples == 37_819
    assert raw.n_thrusters == 8
    assert raw.unknown == ()
    # The first column has no name: a row index, left out with a note.
    assert sum("row index" in r.what for r in raw.repairs) == 6


def test_interpolated_quaternions_are_masked(raw: Log) -> None:
    masked = [r for r in raw.repairs if "no rotation" in r.what]
    assert sum(r.count for r in masked) == 57
    assert min(float(r.what.split("down to ")[1].split(")")[0]) for r in masked) < 0.05
    assert raw.quality().metrics["valid_share"] > 0.99


def test_reversed_roll_and_pitch_rates_are_found(raw: Log) -> None:
    quality = raw.quality()
    assert [f.where for f in quality.errors] == ["p", "q"]
    for name in "pq":
        agreement = quality.kinematics[name]
        assert agreement.scale == pytest.approx(-1.0, abs=0.06)
        assert agreement.correlation < -0.95
        assert "in all runs that move" in agreement.verdict
        assert "scale: -1 in the mapping" in agreement.verdict
    for name in "ruvw":
        assert quality.kinematics[name].scale == pytest.approx(1.0, abs=0.06)
        assert quality.kinematics[name].correlation > 0.95


def test_sample_and_hold_is_found(raw: Log) -> None:
    (finding,) = [f for f in raw.quality().warnings if f.where == "sampling"]
    assert finding.what.startswith("consecutive samples are equal (sample and hold): u 20 %, v 20 %, w 20 %")


def test_turning_the_sign_mends_it() -> None:
    log = read(p={"from": "angular_x", "scale": -1}, q={"from": "angular_y", "scale": -1})
    assert log.quality().errors == []
    log.quality().refuse_errors()


def test_one_run_alone_shows_it_too() -> None:
    quality = read(("random-1",)).quality()
    assert [f.where for f in quality.errors] == ["p", "q"]


def test_without_a_mapping_the_error_gives_one() -> None:
    with pytest.raises(
        Exception, match=r"t: \{from: Time\}, u: \{from: linear_x\}.*qw: \{from: orientation_w\}"
    ):
        Log.read(FOLDER / "surge-1.csv")


def test_the_runs_are_different_dives(raw: Log) -> None:
    train, test, _ = raw.split()
    leakage(train, test)


def test_round_trip(raw: Log, tmp_path: Path) -> None:
    back = Log.read(raw.write(tmp_path / "beluga.parquet"))
    for a, b in zip(raw.runs, back.runs, strict=True):
        assert a.nu.tobytes() == b.nu.tobytes()
        assert a.quaternion.tobytes() == b.quaternion.tobytes()
