"""The mapping file: users' columns, units and frames; typing errors answered with the right word."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log
from tests.log_samples import frame, make_run, same

RUN = make_run(200, wrench=np.random.default_rng(1).normal(size=(200, 6)), nu_dot=np.ones((200, 6)))
TABLE = frame(RUN)


def read(folder: Path, table: pl.DataFrame, mapping: object = None, name: str = "log.parquet") -> Log:
    path = folder / name
    table.write_parquet(path)
    return Log.read(path, mapping)


def test_rename_scale_offset_and_curve(tmp_path: Path) -> None:
    table = TABLE.rename({"u": "linear_x", "t": "Time"}).with_columns(
        (-pl.col("p")).alias("p"),
        (pl.col("voltage") * 1000 + 50).alias("voltage"),
        (1500 + 400 * pl.col("thruster_1")).alias("pwm_1"),
    )
    mapping = tmp_path / "map.yaml"
    mapping.write_text(
        "columns:\n"
        "  t: Time\n"
        "  u: {from: linear_x}\n"
        "  p: {from: p, scale: -1}\n"
        "  voltage: {from: voltage, scale: 0.001, offset: -0.05}\n"
        "  thruster_1: {from: pwm_1, curve: {neutral: 1500, span: 400}}\n"
    )
    log = read(tmp_path, table, mapping)
    same(log.runs[0], RUN, 1e-12)
    assert any("column 'thruster_1' of the file replaced" in r.what for r in log.repairs)


def test_curve_before_scale_and_no_signal(tmp_path: Path) -> None:
    pwm = np.full(200, 1700.0)
    pwm[:4] = [0.0, 65535.0, 1100.0, 2000.0]
    table = TABLE.with_columns(pl.Series("pwm", pwm))
    mapping = {
        "columns": {"thruster_1": {"from": "pwm", "curve": {"neutral": 1500, "span": 400}, "scale": -1}}
    }
    log = read(tmp_path, table, mapping)
    first = log.runs[0].thrusters[:5, 0]
    np.testing.assert_allclose(first, [np.nan, np.nan, 1.0, -1.0, -0.5])
    found = {r.what.split("'")[0]: r.count for r in log.repairs if r.level in ("repair", "warning")}
    assert found == {"values of ": 2, "commands of ": 1}


def test_constant_column(tmp_path: Path) -> None:
    table = TABLE.drop("tau_K")
    with pytest.raises(InputError, match="column tau_K missing"):
        read(tmp_path, table)
    log = read(tmp_path, table, {"columns": {"tau_K": {"value": 0}}})
    assert (log.runs[0].wrench[:, 3] == 0.0).all()


@pytest.mark.parametrize("body", ["FRD", "FLU"])
@pytest.mark.parametrize("world", ["NED", "ENU"])
@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_frames_and_quaternion_order(body: str, world: str, order: str, tmp_path: Path) -> None:
    """A log recorded in other frames, built with scipy's rotations, reads as the original."""
    half = np.diag([1.0, -1.0, -1.0]) if body == "FLU" else np.eye(3)
    turn = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]) if world == "ENU" else np.eye(3)
    original = Rotation.from_quat(RUN.quaternion[:, [1, 2, 3, 0]]).as_matrix()
    xyzw = Rotation.from_matrix(turn @ original @ half).as_quat()
    six = np.kron(np.eye(2), half)
    columns = {n: np.array(c) for n, c in RUN.columns()}
    blocks = {
        ("u", "v", "w", "p", "q", "r"): RUN.nu @ six,
        ("du", "dv", "dw", "dp", "dq", "dr"): RUN.nu_dot @ six,
        ("tau_X", "tau_Y", "tau_Z", "tau_K", "tau_M", "tau_N"): RUN.wrench @ six,
        ("x", "y", "z"): RUN.position @ turn,
        ("qw", "qx", "qy", "qz"): xyzw if order == "xyzw" else xyzw[:, [3, 0, 1, 2]],
    }
    for names, values in blocks.items():
        columns.update(zip(names, values.T, strict=True))
    mapping = {"frame": {"body": body, "world": world}, "quaternion": order}
    back = read(tmp_path, pl.DataFrame(columns), mapping).runs[0]
    sign = np.sign((back.quaternion * RUN.quaternion).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(back.quaternion, sign * RUN.quaternion, atol=1e-9)
    for block in ("nu", "nu_dot", "wrench", "position"):
        np.testing.assert_allclose(getattr(back, block), getattr(RUN, block), atol=1e-12)


def test_scale_comes_before_the_frame(tmp_path: Path) -> None:
    log = read(tmp_path, TABLE, {"columns": {"q": {"scale": -1}}, "frame": {"body": "FLU"}})
    np.testing.assert_array_equal(log.runs[0].nu[:, 4], RUN.nu[:, 4])  # turned twice
    np.testing.assert_array_equal(log.runs[0].nu[:, 5], -RUN.nu[:, 5])


def test_angles_and_rates_in_degrees(tmp_path: Path) -> None:
    table = frame(RUN, euler=True)
    degrees = table.with_columns(
        *(pl.col(n) * (180 / np.pi) for n in ("phi", "theta", "psi", "p", "q", "r", "dp", "dq", "dr"))
    )
    log = read(tmp_path, degrees, {"angles": "deg", "rates": "deg"})
    np.testing.assert_allclose(log.runs[0].nu, RUN.nu, atol=1e-12)
    np.testing.assert_allclose(log.runs[0].nu_dot, RUN.nu_dot, atol=1e-12)
    np.testing.assert_allclose(np.abs((log.runs[0].quaternion * RUN.quaternion).sum(axis=1)), 1.0, atol=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_time_units(unit: str, factor: float, tmp_path: Path) -> None:
    table = TABLE.with_columns(pl.col("t") * factor)
    with pytest.raises(InputError, match=f"is t in {unit}"):
        read(tmp_path, table)
    log = read(tmp_path, table, {"time": {"unit": unit}})
    np.testing.assert_allclose(log.runs[0].t, RUN.t, atol=1e-9)
    assert read(tmp_path, table, {"time": unit}).samples == 200


def test_runs_from_a_column_of_numbers_or_names(tmp_path: Path) -> None:
    table = TABLE.with_columns(
        pl.Series("dive", [7] * 80 + [4] * 120), pl.Series("name", ["b"] * 80 + ["a"] * 120)
    )
    log = read(tmp_path, table, {"run": {"from": "dive"}})
    assert [(r.number, r.samples) for r in log.runs] == [(7, 80), (4, 120)]
    assert "dive" not in log.runs[0].extra
    log = read(tmp_path, table, {"run": {"from": "name"}})
    assert [(r.number, r.samples) for r in log.runs] == [(1, 80), (2, 120)]
    assert any("numbered from 1: b, a" in r.what for r in log.repairs)
    with pytest.raises(InputError, match="Did you mean 'dive'"):
        read(tmp_path, table, {"run": {"from": "dives"}})


def test_several_files_are_never_joined(tmp_path: Path) -> None:
    paths = []
    for i in range(3):
        path = tmp_path / f"dive{i}.csv"
        frame(make_run(100, phase=i)).with_columns(pl.lit(1).alias("run")).write_csv(path)
        paths.append(path)
    log = Log.read(paths)
    assert [r.number for r in log.runs] == [1, 2, 3]
    assert log.paths == tuple(paths)
    with pytest.raises(ConfigError, match="named twice"):
        Log.read([paths[0], paths[0]])
    paths[1].write_bytes(paths[0].read_bytes())
    with pytest.raises(InputError, match="same bytes"):
        Log.read(paths)
    with pytest.raises(ConfigError, match="no log file"):
        Log.read([])


def test_files_of_different_vehicles_are_refused(tmp_path: Path) -> None:
    frame(make_run(100)).write_csv(tmp_path / "a.csv")
    frame(make_run(100, thrusters=np.zeros((100, 8)))).write_csv(tmp_path / "b.csv")
    with pytest.raises(InputError, match=r"thrusters \(4\), thrusters \(8\)"):
        Log.read([tmp_path / "a.csv", tmp_path / "b.csv"])


@pytest.mark.parametrize(
    ("mapping", "word"),
    [
        ({"colums": {}}, "Did you mean 'columns'"),
        ({"columns": {"thruster1": "a"}}, "Did you mean 'thruster_1'"),
        ({"columns": {"qx": {"form": "a"}}}, "Did you mean 'from'"),
        ({"columns": {"u": {"from": "u", "scale": "fast"}}}, "not a finite number"),
        ({"columns": {"u": {"from": "u", "scale": True}}}, "not a finite number"),
        ({"columns": {"u": {"from": "u", "scale": float("nan")}}}, "not a finite number"),
        ({"columns": {"u": {"from": "u", "scale": 0}}}, "wipe"),
        ({"columns": {"u": {"from": 3}}}, "must be a column's name"),
        ({"columns": {"u": 3}}, "must name a column"),
        ({"columns": {"u": {"value": 1, "scale": 2}}}, "stands alone"),
        ({"columns": {"u": {"curve": {"neutral": 1500}}}}, "needs 'span'"),
        ({"columns": {"u": {"curve": {"neutral": 1500, "span": 0}}}}, "must not be 0"),
        ({"columns": {"u": {"curve": 1500}}}, "neutral"),
        ({"columns": ["u"]}, "name: value"),
        ({"frame": {"body": "FRU"}}, "Did you mean 'FRD'"),
        ({"frame": {"wrld": "NED"}}, "Did you mean 'world'"),
        ({"angles": "degree"}, "Did you mean 'deg'"),
        ({"quaternion": "wzyx"}, "There are: wxyz, xyzw"),
        ({"time": {"unit": "min"}}, "choice called 'min'"),
        ({"run": 3}, "neither"),
        ({"run": {"from": None}}, "must name a column"),
    ],
)
def test_wrong_mappings_are_refused(mapping: dict, word: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=word) as caught:
        read(tmp_path, TABLE, mapping)
    assert "\n" not in str(caught.value)


def test_a_mapped_column_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"takes 'u' from .* Did you mean 'linear_x'"):
        read(tmp_path, TABLE.rename({"u": "linear_x"}), {"columns": {"u": "linear_X"}})


def test_missing_columns_come_with_a_mapping_to_copy(tmp_path: Path) -> None:
    table = frame(RUN, euler=True).rename(
        {"t": "time [ms]", "u": "linear.x", "psi": "Heading (deg)", "phi": "roll_deg", "r": "yaw rate"}
    )
    with pytest.raises(InputError) as caught:
        read(tmp_path, table)
    message = str(caught.value)
    assert "columns t, u, r, phi, psi missing" in message
    for part in (
        "t: {from: 'time [ms]'}",
        "u: {from: linear.x}",
        "psi: {from: 'Heading (deg)'}",
        "r: {from: 'yaw rate'}",
        "angles: deg",
        "time: {unit: ms}",
    ):
        assert part in message
    # What the message proposes works.
    columns = {"t": "time [ms]", "u": "linear.x", "psi": "Heading (deg)", "phi": "roll_deg", "r": "yaw rate"}
    assert read(tmp_path, table, {"columns": columns}).samples == 200


def test_no_command_at_all(tmp_path: Path) -> None:
    table = TABLE.drop([n for n in TABLE.columns if n.startswith(("tau_", "thruster_"))])
    with pytest.raises(InputError, match="neither thruster_1"):
        read(tmp_path, table)
    pwm = {f"pwm{i}": np.full(200, 1500.0) for i in (1, 2, 10)}
    with pytest.raises(InputError, match="pwm1, pwm2, pwm10"):
        read(tmp_path, table.with_columns(**{k: pl.Series(v) for k, v in pwm.items()}))


def test_thruster_numbers_without_a_gap(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no thruster_2"):
        read(tmp_path, TABLE.rename({"thruster_2": "thruster_9"}))


def test_raw_pwm_is_refused_with_the_curve(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"curve: \{neutral: 1500, span: 400\}"):
        read(tmp_path, TABLE.with_columns(pl.col("thruster_1") * 400 + 1500))


def test_depth_alone_is_a_position(tmp_path: Path) -> None:
    log = read(tmp_path, TABLE.drop(["x", "y"]))
    run = log.runs[0]
    assert "z" in run.channels
    assert "x" not in run.channels
    assert len(run.segments()) == 1
    assert any("only z" in r.what for r in log.repairs)


def test_a_delay_puts_late_columns_back_to_their_time(tmp_path: Path) -> None:
    """u logged 0.25 s late, between two rows: it comes back as it was, but for the last rows."""
    t = 0.1 * np.arange(200)
    table = TABLE.with_columns(
        pl.Series("t", t), pl.Series("u", 0.05 * (t - 0.25)), pl.Series("v", np.sin(t))
    )
    log = read(tmp_path, table, {"columns": {"u": {"delay": 0.25}, "v": {"delay": -0.1}}})
    u, v = log.runs[0].nu[:, 0], log.runs[0].nu[:, 1]
    np.testing.assert_allclose(u[:197], 0.05 * t[:197], atol=1e-12)
    assert np.isnan(u[197:]).all() and np.isnan(v[0])
    np.testing.assert_allclose(v[1:], np.sin(t[:-1]), atol=1e-12)
    assert any("put back by their delay: u 0.25 s, v -0.1 s" in r.what for r in log.repairs)


def test_a_delay_invents_nothing_across_gaps_and_holes(tmp_path: Path) -> None:
    t = 0.1 * np.arange(200)
    t[100:] += 3.0
    u = 0.01 * np.arange(200.0)
    u[50] = np.nan
    table = TABLE.with_columns(pl.Series("t", t), pl.Series("u", u))
    found = read(tmp_path, table, {"columns": {"u": {"delay": 0.05}}}).runs[0].nu[:, 0]
    assert np.flatnonzero(np.isnan(found)).tolist() == [49, 50, 99, 199]
    np.testing.assert_allclose(found[:49], u[:49] + 0.005)


@pytest.mark.parametrize(
    ("column", "words"),
    [
        ({"qx": {"delay": 0.1}}, "take no delay"),
        ({"u": {"delay": 200}}, "seconds"),
        ({"t": {"delay": 0.1}}, "no delay"),
    ],
)
def test_delays_that_make_no_sense_are_refused(tmp_path: Path, column: dict, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        read(tmp_path, TABLE, {"columns": column})
