"""What a mapping says about topics: units, mixers, displacements, differences, frames, clocks, headings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auvnn.errors import AuvnnError, ConfigError, InputError
from auvnn.logs import Log, Run
from auvnn.logs.readers.base import Table
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.mapping_file.units import UNITS
from auvnn.logs.reading.recordings.assemble import from_recording
from auvnn.logs.recording import Recording, Topic
from auvnn.logs.signals import differences
from tests.log_samples import frame, make_run

RUN = make_run(800, dt=0.02)
T = np.array(RUN.t)
WXYZ = RUN.quaternion
TURN = Rotation.from_quat(WXYZ[:, [1, 2, 3, 0]].copy())


def topic(name: str, t: np.ndarray, **columns: Any) -> Topic:
    return Topic(
        name, "made", np.array(t), {n.replace("__", "."): np.array(c, float) for n, c in columns.items()}
    )


def state(t: np.ndarray = T) -> Topic:
    names = ("qw", "qx", "qy", "qz", "u", "v", "w", "p", "q", "r", "x", "y", "z")
    values = np.concatenate([WXYZ, RUN.nu, RUN.position], axis=1)
    return topic("/state", t, **dict(zip(names, values.T, strict=True)))


def commands(t: np.ndarray = T) -> Topic:
    return topic("/cmd", t, **{f"c{i}": c for i, c in enumerate(RUN.thrusters.T)})


IDENTITY = {
    n: f"/state.{n}" for n in ("qw", "qx", "qy", "qz", "u", "v", "w", "p", "q", "r", "x", "y", "z")
} | {"thruster_1": "/cmd.c0"}


def made(topics: list[Topic], columns: dict[str, Any], /, **more: Any) -> tuple[Run, Table]:
    """Return the run that a mapping makes of topics, by the same steps as from a file."""
    from auvnn.logs.reading.collect import Collector, collect

    plan = Mapping.read({"columns": columns} | more)
    table = from_recording(Recording({t.name: t for t in topics}), plan, "made")
    collector = Collector()
    collect(table, plan, Path("made"), collector)
    return collector.runs[0], table


def test_paths_lead_to_fields_and_instances() -> None:
    first = topic("BARO[0]", T, Alt=np.zeros(len(T)))
    second = topic("BARO[1]", T, Alt=RUN.position[:, 2])
    run, _ = made([state(), commands(), first, second], IDENTITY | {"z": "BARO[1].Alt"})
    np.testing.assert_array_equal(run.position[:, 2], RUN.position[:, 2])
    with pytest.raises(InputError, match=r"several instances; say which in mapping: BARO\[0\], BARO\[1\]"):
        made([state(), commands(), first, second], IDENTITY | {"z": "BARO.Alt"})
    with pytest.raises(InputError, match="no field of /state called 'uu'"):
        made([state(), commands()], IDENTITY | {"u": "/state.uu"})
    with pytest.raises(InputError, match="topic that is not there"):
        made([state(), commands()], IDENTITY | {"u": "/stat.u"})


@pytest.mark.parametrize(
    ("unit", "value", "si"),
    [("deg", 180.0, np.pi), ("kn", 1.0, 1852 / 3600), ("hPa", 1013.25, 101325.0), ("cm/s", 100.0, 1.0),
     ("rpm", 60.0, 2 * np.pi), ("ft", 1.0, 0.3048), ("psi", 14.6959487755, 101325.0), ("lbf", 1.0, 4.4482216152605)],
)  # fmt: skip
def test_units_by_name(unit: str, value: float, si: float) -> None:
    assert value * UNITS[unit] == pytest.approx(si, rel=1e-9)


def test_a_unit_in_a_table_is_not_turned_twice(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    table = frame(RUN, euler=True)
    table.with_columns((table["psi"] * 180 / np.pi).alias("psi"), (table["u"] * 100).alias("u")).write_csv(
        path
    )
    columns = {"psi": {"from": "psi", "unit": "deg"}, "u": {"from": "u", "unit": "cm/s"}}
    back = Log.read(path, {"columns": columns}).runs[0]
    np.testing.assert_allclose(np.abs((back.quaternion * WXYZ).sum(axis=1)), 1.0, atol=1e-12)
    np.testing.assert_allclose(back.nu, RUN.nu, atol=1e-12)


def test_a_mixer_of_six_channels_for_eight_thrusters() -> None:
    random = np.random.default_rng(0)
    mixer = random.choice([-1.0, 0.0, 1.0], (8, 6)) * 0.3
    sticks = random.uniform(-1, 1, (len(T), 6))
    rc = topic("RCIN", T, **{f"C{i + 1}": 1500 + 400 * sticks[:, i] for i in range(6)})
    columns = {n: s for n, s in IDENTITY.items() if n != "thruster_1"}
    for k in range(8):
        mix = [{"from": f"RCIN.C{i + 1}", "weight": float(mixer[k, i])} for i in range(6)]
        columns[f"thruster_{k + 1}"] = {"mix": mix, "curve": {"neutral": 1500, "span": 400}}
    run, _ = made([state(), rc], columns)
    np.testing.assert_allclose(run.thrusters, np.clip(sticks @ mixer.T, -1, 1), atol=1e-12)


def test_displacements_over_their_times_are_velocities_in_their_middles() -> None:
    dt = 0.1
    when = np.arange(1.0, 15.0, dt)
    inside = np.stack([np.interp(when - 0.5 * dt, T, c) for c in RUN.nu[:, :3].T], axis=1)
    viso = topic(
        "VISO",
        when,
        PosDX=inside[:, 0] * dt,
        PosDY=inside[:, 1] * dt,
        PosDZ=inside[:, 2] * dt,
        dt=np.full(len(when), dt * 1e6),
    )
    over = {"from": "VISO.dt", "unit": "us"}
    columns = IDENTITY | {
        n: {"from": f"VISO.PosD{a}", "over": over} for n, a in zip("uvw", "XYZ", strict=True)
    }
    run, _ = made([state(), commands(), viso], columns)
    assert run.t[0] == pytest.approx(when[0] - 0.5 * dt)
    np.testing.assert_allclose(run.nu[:, :3], inside, atol=1e-9)


def test_velocities_as_differences_of_positions_turned_into_the_body() -> None:
    columns = {n: s for n, s in IDENTITY.items() if n not in "uvw"}
    columns |= {
        n: {"from": f"/state.{a}", "difference": True, "in": "world"}
        for n, a in zip("uvw", "xyz", strict=True)
    }
    run, _ = made([state(), commands()], columns)
    truth = np.stack([np.interp(run.t, T, c) for c in RUN.nu[:, :3].T], axis=1)
    assert np.nanmax(np.abs(run.nu[:, :3] - truth)) < 2e-4  # second order in 0.02 s
    assert len(run.t) == len(T) - 1


def test_a_difference_of_attitudes_is_the_body_rate() -> None:
    t, rate = differences.of_attitudes(T, WXYZ)
    truth = np.stack([np.interp(t, T, c) for c in RUN.nu[:, 3:].T], axis=1)
    assert np.abs(rate - truth).max() < 2e-4


@pytest.mark.parametrize("frame_of", ["NED", "ENU"])
def test_velocities_in_the_world(frame_of: str) -> None:
    world = TURN.apply(RUN.nu[:, :3].copy())
    told = world if frame_of == "NED" else world[:, [1, 0, 2]] * [1, 1, -1]
    local = topic("/local", T, a=told[:, 0], b=told[:, 1], c=told[:, 2])
    columns = IDENTITY | {
        n: {"from": f"/local.{f}", "in": "world"} for n, f in zip("uvw", "abc", strict=True)
    }
    run, _ = made([state(), commands(), local], columns, topics={"/local": {"world": frame_of}})
    np.testing.assert_allclose(run.nu, RUN.nu, atol=1e-12)
    with pytest.raises(ConfigError, match="takes all of u, v, w"):
        made([state(), commands(), local], IDENTITY | {"u": {"from": "/local.a", "in": "world"}})


def test_frames_by_topic() -> None:
    flu = np.array([1, -1, -1])
    enu = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    xyzw = Rotation.from_matrix(enu @ TURN.as_matrix() @ np.diag(flu)).as_quat()
    place = RUN.position @ enu.T
    odom = topic("/odom", T, qx=xyzw[:, 0], qy=xyzw[:, 1], qz=xyzw[:, 2], qw=xyzw[:, 3], u=RUN.nu[:, 0], v=-RUN.nu[:, 1],
                 w=-RUN.nu[:, 2], x=place[:, 0], y=place[:, 1], z=place[:, 2])  # fmt: skip
    columns = IDENTITY | {n: f"/odom.{n}" for n in ("qw", "qx", "qy", "qz", "u", "v", "w", "x", "y", "z")}
    run, _ = made([state(), commands(), odom], columns, topics={"/odom": {"body": "FLU", "world": "ENU"}})
    np.testing.assert_allclose(run.nu, RUN.nu, atol=1e-12)
    np.testing.assert_allclose(run.position, RUN.position, atol=1e-12)
    np.testing.assert_allclose(np.abs((run.quaternion * WXYZ).sum(axis=1)), 1.0, atol=1e-12)


def test_a_heading_offset_by_run() -> None:
    run, _ = made(
        [state(), commands()], IDENTITY, heading={"offset": 10.0, "unit": "deg", "runs": {"1": 30.0}}
    )
    off = np.unwrap(run.euler[:, 2] - RUN.euler[:, 2])
    np.testing.assert_allclose(np.remainder(off, 2 * np.pi), np.radians(30.0), atol=1e-9)
    np.testing.assert_allclose(run.euler[:, :2], RUN.euler[:, :2], atol=1e-9)


def test_depth_from_pressure() -> None:
    baro = topic("/baro", T, p=1013.25 + 1030 * 9.80665 * RUN.position[:, 2] / 100)
    spec = {"from": "/baro.p", "unit": "hPa", "pressure": {"surface": 101325, "density": 1030}}
    run, _ = made([state(), commands(), baro], IDENTITY | {"z": spec})
    np.testing.assert_allclose(run.position[:, 2], RUN.position[:, 2], atol=1e-9)


@pytest.mark.parametrize("offset", [6752.3, -41.7])
def test_another_computers_clock_is_found_by_the_motion(offset: float) -> None:
    random = np.random.default_rng(1)
    late = topic("/mocap", T[50:700] - offset, **{n: c[50:700] for n, c in state().columns.items()})
    late.columns = {n: c + 0.002 * random.normal(size=len(c)) for n, c in late.columns.items()}
    columns = IDENTITY | {n: f"/mocap.{n}" for n in ("u", "v", "w")}
    own = {n: f"/state.{n}" for n in ("x", "y", "z")}
    run, table = made([state(), commands(), late], columns | own, topics={"/mocap": {"offset": "auto"}})
    words = next(r.what for r in table.repairs if "set by" in r.what)
    assert float(words.split("set by ")[1].split(" s")[0]) == pytest.approx(offset, abs=0.02)
    assert run.t[0] == pytest.approx(T[50], abs=0.02)


def test_an_offset_that_nothing_shows_is_refused() -> None:
    random = np.random.default_rng(2)
    other = topic(
        "/other", T, u=random.normal(size=len(T)), v=random.normal(size=len(T)), w=random.normal(size=len(T))
    )
    columns = IDENTITY | {n: f"/other.{n}" for n in "uvw"}
    with pytest.raises(InputError, match="offset: auto finds none"):
        made([state(), commands(), other], columns, topics={"/other": {"offset": "auto"}})


def test_known_offsets_and_delays_move_times() -> None:
    shifted = topic("/state", T - 5.0 + 0.3, **state().columns)
    run, _ = made([shifted, commands()], IDENTITY, topics={"/state": {"offset": 5.0, "delay": 0.3}})
    np.testing.assert_allclose(run.t, T, atol=1e-9)


def test_the_core_in_use_is_followed() -> None:
    number = (T > 8.0).astype(float)
    cores = [
        topic(f"XKF1[{k}]", T + 0.001 * k, VN=RUN.nu[:, 0] + 10 * k, VE=RUN.nu[:, 1], VD=RUN.nu[:, 2])
        for k in (0, 1)
    ]
    columns = IDENTITY | {n: f"XKF1[primary].{f}" for n, f in zip("uvw", ("VN", "VE", "VD"), strict=True)}
    run, _ = made([state(), commands(), *cores, topic("XKF4[0]", T, PI=number)], columns)
    jump = np.interp(run.t, T, RUN.nu[:, 0])
    np.testing.assert_allclose(run.nu[:, 0] - jump, 10.0 * (run.t > 8.005), atol=1e-2)


@pytest.mark.parametrize(
    ("plan", "words"),
    [
        ({"columns": {"u": {"from": "a", "unit": "furlong"}}}, "no unit called 'furlong'"),
        ({"columns": {"thruster_1": {"mix": {"a": 1}}}}, "must be a list"),
        ({"columns": {"thruster_1": {"mix": [{"from": "a"}], "from": "b"}}}, "give one of them"),
        ({"columns": {"z": {"from": "a", "difference": True}}}, "it is for u, v, w"),
        ({"columns": {"p": {"from": "a", "in": "world"}}}, "of u, v and w"),
        ({"columns": {"u": {"from": "a", "pressure": {}}}}, "belongs to z"),
        ({"topics": {"/a": {"body": "NED"}}}, "no choice called 'NED'"),
        ({"topics": {"/a": {"ofset": 1}}}, "Did you mean 'offset'"),
        ({"commands": {"between": "cubic"}}, "no choice called 'cubic'"),
        ({"commands": {"longest": -1}}, "must be above zero"),
        ({"heading": {"offset": "north"}}, "not a finite number"),
        ({"rows": 3}, "must be a name"),
    ],
)
def test_mistakes_are_named(plan: dict[str, Any], words: str) -> None:
    with pytest.raises(AuvnnError, match=words):
        Mapping.read(plan)
