"""The study on public simulators: its logs and its models, by stand-ins with the simulators' interfaces."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import auvnn
from auvnn.effects import EFFECTS

HERE = Path(__file__).resolve().parents[2] / "experiments" / "public_simulator"
MODULES = ("run", "logged", "remus", "remus_changes", "bluerov2", "bluerov2_changes", "BlueROV2")
# A vehicle with the interface of the simulator's class, and numbers of our own: six masses with linear drag.
VEHICLE = """
import numpy as np

class remus100:
    def __init__(self):
        self.L, self.diam, self.rho, self.S, self.CD_0 = 1.5, 0.2, 1000, 0.2, 0.06
        self.nMax, self.T_delta, self.T_n = 1500, 1.0, 1.0
        self.deltaMax_r = self.deltaMax_s = np.pi / 6
        self.A_r, self.A_s, self.CL_delta_r, self.CL_delta_s = 0.005, 0.01, 0.5, 0.7
        self.r_bg, self.r_bb = np.array([0.0, 0.0, 0.02]), np.zeros(3)
        self.MRB = np.diag([30.0, 30.0, 30.0, 0.2, 4.0, 4.0])
        self.MA = np.diag([1.0, 30.0, 30.0, 0.1, 3.0, 3.0])
        self.M = self.MRB + self.MA
        self.Minv = np.linalg.inv(self.M)
        self.T_heave, self.zeta_roll, self.zeta_pitch, self.w_roll, self.w_pitch = 20.0, 0.3, 0.8, 4.0, 0.9
        self.W = self.B = 294.3
        self.V_c = self.beta_c = 0.0

    def dynamics(self, eta, nu, u_actual, u_control, sampleTime):
        lag = np.array([self.T_delta, self.T_delta, self.T_n])
        rudder, stern, speed = u_actual
        force = np.array([0.04 * speed, 0.0, self.W - self.B, -6.0 * eta[3], 4.0 * stern - 6.0 * eta[4], 4.0 * rudder])
        moved = nu + sampleTime * (self.Minv @ (force - np.diag([25.0, 40, 40, 1, 8, 8]) @ nu))
        return moved, u_actual + sampleTime * (u_control - u_actual) / lag
"""
# The same for the ROV: masses with linear drag, buoyancy, thrusters whose thrust grows with the square of the command.
ROV = """
import numpy as np

class Lag:
    def step(self, thrust, dt):
        self.thrust = getattr(self, "thrust", 0.0) + min(1.0, dt / 0.01) * (thrust - getattr(self, "thrust", 0.0))
        return self.thrust

class BlueROV2:
    def __init__(self):
        self.m, self.g, self.n_thrusters = 12.0, 9.82, 8
        self.W = self.B = self.m * self.g
        self.xb, self.yb, self.zb = 0.0, 0.0, -0.02
        self.MRB = np.diag([12.0, 12.0, 12.0, 0.3, 0.3, 0.3])
        self.Xu_dot, self.Yv_dot, self.Zw_dot, self.Kp_dot, self.Mq_dot, self.Nr_dot = -5.0, -6.0, -7.0, -0.1, -0.2, -0.3
        self.MA = np.diag([5.0, 6.0, 7.0, 0.1, 0.2, 0.3])
        self.M = self.MRB + self.MA
        self.Minv = np.linalg.inv(self.M)
        self.Xu_abs, self.Yv_abs, self.Zw_abs, self.Kp_abs, self.Mq_abs, self.Nr_abs = -90.0, -90, -90, -1, -1, -1
        self.Yv = self.Nr = 0.0
        self.current_speed = np.zeros(3)
        self.thruster_lags = [Lag() for _ in range(8)]
        slanted, flat = [(1, -1), (1, 1), (-1, -1), (-1, 1)], [(1, 1), (1, -1), (-1, 1), (-1, -1)]
        self.thrusters_r = [{"r": np.array([0.15 * x, 0.1 * y, 0.08]), "dir": np.array([a, b, 0]) / np.sqrt(2)}
                            for (x, y), (a, b) in zip(flat, slanted)]
        self.thrusters_r += [{"r": np.array([0.1 * x, 0.2 * y, 0.0]), "dir": np.array([0, 0, -1.0])} for x, y in flat]

    def thrust(self, command):
        return 40.0 * command * abs(command)

    def _thruster_force_from_input(self, command, i, dt):
        return self.thruster_lags[i].step(self.thrust(command), dt)

    def compute_thruster_forces(self, commands, dt):
        forces = [self._thruster_force_from_input(c, i, dt) for i, c in enumerate(commands)]
        return sum(np.array([*(f * t["dir"]), *np.cross(t["r"], f * t["dir"])]) for f, t in zip(forces, self.thrusters_r))

    def dynamics(self, x, commands, dt):
        nu, phi, theta = x[6:], x[3], x[4]
        drag = np.array([self.Xu_abs, self.Yv_abs, self.Zw_abs, self.Kp_abs, self.Mq_abs, self.Nr_abs])
        flow = nu - np.array([*self.current_speed, 0, 0, 0])
        force = self.compute_thruster_forces(commands, dt) + (drag * abs(flow) + [0, self.Yv, 0, 0, 0, self.Nr]) * flow
        force[2] += self.W - self.B
        force[3:5] += self.B * np.array([self.zb * np.sin(phi), self.zb * np.sin(theta) + self.xb])
        c, s = np.cos(x[5]), np.sin(x[5])
        return np.array([c * nu[0] - s * nu[1], s * nu[0] + c * nu[1], *nu[2:], *(self.Minv @ force)])
"""
KINEMATICS = """
import numpy as np

def attitudeEuler(eta, nu, sampleTime):
    eta[:3] += sampleTime * np.array([nu[0] * np.cos(eta[5]), nu[0] * np.sin(eta[5]), nu[2] - nu[0] * np.sin(eta[4])])
    eta[3:] += sampleTime * nu[3:]
    return eta
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The study's modules, and a checkout with a stand-in for the simulator."""
    checkout = tmp_path_factory.mktemp("checkout")
    package = checkout / "src" / "python_vehicle_simulator"
    for folder in (package, package / "lib", package / "vehicles"):
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text("")
    (package / "vehicles" / "remus100.py").write_text(VEHICLE)
    (package / "lib" / "gnc.py").write_text(KINEMATICS)
    before = set(sys.modules)
    sys.path.insert(0, str(HERE))
    try:
        sys.modules.pop("run", None)
        import remus
        import run

        yield remus, run, remus.simulator(checkout)
    finally:
        sys.path[:] = [p for p in sys.path if p not in (str(HERE), str(checkout / "src"))]
        for name in set(sys.modules) - before:
            if name in MODULES or name.startswith("python_vehicle_simulator"):
                del sys.modules[name]


def test_a_folder_without_the_simulator_is_refused_in_one_line(study, tmp_path):
    with pytest.raises(SystemExit, match="no python_vehicle_simulator"):
        study[0].simulator(tmp_path)


@pytest.mark.parametrize(("name", "value"), [("deltaMax_r", 0.26), ("T_n", 0.1), ("Minv", -np.eye(6))])
def test_another_version_of_the_vehicle_is_refused(study, monkeypatch, name, value):
    """Later ones have other limits, lags, and a stern plane with the opposite sign."""
    remus, _, module = study
    vehicle = module.remus100()
    assert remus._is_known(vehicle)
    setattr(vehicle, name, value)
    assert not remus._is_known(vehicle)
    checkout = Path(module.__file__).parents[2]
    monkeypatch.setattr(module, "remus100", lambda: vehicle)
    with pytest.raises(SystemExit, match=f"another version of the vehicle; git checkout {remus.COMMIT}"):
        remus.simulator(checkout)


def test_a_number_that_the_vehicle_does_not_have_hides_nothing_and_is_refused(study):
    import logged

    remus, _, module = study
    with pytest.raises(SystemExit, match="no V_cc"):
        remus.Plant(module, change=logged.with_values(V_cc=0.3)).vehicle()


def test_a_change_that_there_is_not_is_refused_before_anything_is_run(study, tmp_path):
    with pytest.raises(SystemExit, match="fin_gian: no such change; there are nothing, ocean_current"):
        study[1].main(str(tmp_path / "nowhere"), tmp_path / "out", ["fin_gian"])
    assert not (tmp_path / "out").exists()


def test_a_run_is_a_log_that_the_package_reads(study, tmp_path, monkeypatch):
    import logged

    remus, _, module = study
    monkeypatch.setattr(remus, "DURATION", 4.0)
    log = auvnn.Log.read(remus.Plant(module).write(tmp_path / "log.parquet", 1))
    assert len(log) == logged.RUNS
    assert [len(r.t) for r in log.runs] == [81] * logged.RUNS
    np.testing.assert_allclose(np.diff(log[0]["t"]), 0.05, atol=1e-9)
    # The attitude is that of the same roll, pitch and yaw: a unit quaternion, and nearly level.
    q = np.stack([log[c] for c in ("qw", "qx", "qy", "qz")])
    np.testing.assert_allclose(np.linalg.norm(q, axis=0), 1.0, atol=1e-9)
    assert np.abs(2 * (q[0] * q[1] + q[2] * q[3])).max() < 0.1


def test_what_is_hidden_shows_in_the_motion_and_not_in_the_commands_that_are_logged(study, monkeypatch):
    remus, run, module = study
    monkeypatch.setattr(remus, "DURATION", 6.0)
    commands = slice(14, 17)
    plain = remus.Plant(module).run(3)
    # The stand-in has no current, centre of gravity or fins' lift: those need the simulator itself.
    for name in (
        "thruster_gain",
        "net_buoyancy",
        "added_mass",
        "fin_offset",
        "fin_lag",
        "propeller_lag",
        "payload",
    ):
        other = remus.Plant(module, **run.REMUS.changes[name]).run(3)
        assert np.abs(other - plain)[:, 5:14].max() > 0.003, name
        np.testing.assert_array_equal(other[0, commands], plain[0, commands])
    half = len(plain) // 2
    # Each run has a vehicle of its own: what is taken up in one is not there when the next begins.
    again = remus.Plant(module, **run.REMUS.changes["payload"])
    np.testing.assert_array_equal(again.run(3), again.run(3))
    np.testing.assert_array_equal(
        remus.Plant(module, **run.REMUS.changes["payload"]).run(3)[:half], plain[:half]
    )
    offset = remus.Plant(module, **run.REMUS.changes["gyro_bias"]).run(3) - plain
    np.testing.assert_allclose(offset[:, 10], 0.01, atol=1e-12)
    assert not np.delete(offset, 10, axis=1).any()
    scaled = remus.Plant(module, **run.REMUS.changes["velocity_scale"]).run(3) - plain
    assert np.abs(scaled[:, 5]).max() > 0.03
    assert not np.delete(scaled, [5, 6, 7], axis=1).any()


def test_the_model_is_one_that_the_package_takes_and_has_the_vehicles_numbers(study, tmp_path):
    remus, _, module = study
    vehicle = remus.Plant(module).vehicle()
    assert vehicle.T_delta == vehicle.T_n == remus.LAG
    given = remus.description(vehicle)
    path = tmp_path / "given.yaml"
    path.write_text(yaml.safe_dump(given))
    model = auvnn.load(path)
    assert sorted(model.effect_names) == sorted(given["effects"])
    added = model.prepare().added.numpy()
    np.testing.assert_allclose(added, vehicle.MA, atol=1e-12)
    rigid = model.prepare().rigid.numpy()
    np.testing.assert_allclose(np.diag(rigid), np.diag(vehicle.MRB), rtol=1e-9)


def test_the_names_are_those_of_the_catalogue_and_the_readme_tells_what_came_out(study):
    run = study[1]
    assert set(run.REMUS.changes) - {"nothing"} <= set(EFFECTS.names())
    expected = {r["hidden"]: r for r in json.loads((HERE / "expected.json").read_text())}
    assert set(expected) == set(run.REMUS.changes)
    text = (HERE / "README.md").read_text()
    rows = {
        n: (said, s) for n, said, s in re.findall(r"^\| `?(\w+)`? \| (.*?) \| .* \| (\d+) \|$", text, re.M)
    }
    assert set(rows) == set(expected)
    for name, row in expected.items():
        said = ", then ".join(" or ".join(f"`{e}`" for e in group) for group in row["groups"])
        assert rows[name][0].replace("**", "") == (said or row["verdict"]), name
        assert rows[name][1] == f"{row['seconds']:.0f}"
    hidden = [r for r in expected.values() if r["hidden"] != "nothing"]
    first = [r for r in hidden if r["first"]]
    assert f"{len(first)} of {len(hidden)} are named first" in text
    alone = sum(len(r["groups"][0]) == 1 for r in first)
    assert f"{alone} alone, {len(first) - alone} in a group" in text
    wrong = [r for r in expected.values() if r["groups"] and not r["first"]]
    assert f"A wrong name comes first in {len(wrong)} of {len(expected)}" in text
    assert all(f"`{r['groups'][0][0]}` (" in text for r in wrong)
    assert all(r["first"] == (r["hidden"] in (r["groups"] or [[]])[0]) for r in expected.values())
    assert f"| {round(float(np.median([r['seconds'] for r in expected.values()])))} s |" in text


def test_the_readme_tells_what_came_out_of_other_logs(study):
    rows = json.loads((HERE / "expected-150.json").read_text())
    text = (HERE / "README.md").read_text().partition("## Other logs")[2].partition("\n## ")[0]
    told = {n: (said, s) for n, said, s in re.findall(r"^\| `?(\w+)`? \| ([^|]*?) \| (\d+) \|$", text, re.M)}
    assert set(told) == {r["hidden"] for r in rows} <= set(study[1].REMUS.changes)
    for row in rows:
        said = ", then ".join(" or ".join(f"`{e}`" for e in group) for group in row["groups"])
        assert told[row["hidden"]] == (told[row["hidden"]][0], f"{row['seconds']:.0f}")
        assert told[row["hidden"]][0].replace("**", "") == (said or row["verdict"])
    hidden = [r for r in rows if r["hidden"] != "nothing"]
    wrong = [r for r in rows if r["groups"] and r["hidden"] not in r["groups"][0]]
    assert f"{sum(r['first'] for r in hidden)} of {len(hidden)} are named first and none has a wrong" in text
    assert not wrong


def test_another_seed_is_another_log(study, tmp_path, monkeypatch):
    """Of a change the same headings and noise come with the same seed, others with another one."""
    run = study[1]
    seeds = []

    def refuse(self, path, seed):
        seeds.append(seed)
        raise KeyboardInterrupt

    plant = type("Plant", (), {"__init__": lambda *_, **__: None, "write": refuse})
    monkeypatch.setattr(run, "REMUS", replace(run.REMUS, simulator=lambda folder: None, plant=plant))
    monkeypatch.setattr(run, "fitted", lambda study, module, out: out)
    for more in ((), (150,)):
        with pytest.raises(KeyboardInterrupt):
            run.main("", tmp_path / "out", ["ocean_current"], *more)
    assert seeds == [51, 151]


@pytest.fixture(scope="module")
def rov(study, tmp_path_factory):
    """The study on the BlueROV2, and a checkout with a stand-in for that simulator."""
    import bluerov2

    checkout = tmp_path_factory.mktemp("rov")
    (checkout / "fossen").mkdir()
    (checkout / "fossen" / "BlueROV2.py").write_text(ROV)
    try:
        yield bluerov2, study[1], bluerov2.simulator(checkout), checkout
    finally:
        sys.path[:] = [p for p in sys.path if p != str(checkout / "fossen")]


def test_the_checkout_tells_which_vehicle_it_has(rov, tmp_path):
    bluerov2, run, _, checkout = rov
    assert run.study_of(checkout) is run.BLUEROV2
    assert run.study_of(tmp_path) is run.REMUS
    with pytest.raises(SystemExit, match=r"no fossen/BlueROV2\.py"):
        bluerov2.simulator(tmp_path)


@pytest.mark.parametrize(("name", "value"), [("MA", -np.eye(6)), ("Xu_abs", 10.0), ("thruster_lags", [])])
def test_another_version_of_the_rov_is_refused(rov, monkeypatch, name, value):
    bluerov2, _, module, checkout = rov
    vehicle = module.BlueROV2()
    assert bluerov2._is_known(vehicle)
    setattr(vehicle, name, value)
    monkeypatch.setattr(module, "BlueROV2", lambda: vehicle)
    with pytest.raises(SystemExit, match=f"another version of the vehicle; git checkout {bluerov2.COMMIT}"):
        bluerov2.simulator(checkout)


def test_a_run_of_the_rov_is_a_log_that_the_package_reads(rov, tmp_path, monkeypatch):
    bluerov2, _, module, _ = rov
    monkeypatch.setattr(bluerov2, "DURATION", 4.0)
    log = auvnn.Log.read(bluerov2.Plant(module).write(tmp_path / "log.parquet", 1))
    assert [len(r.t) for r in log.runs] == [81] * 3
    commands = np.stack([log[f"thruster_{i + 1}"] for i in range(8)])
    # Each thruster is used, within what the class's polynomial lets grow.
    assert (commands.std(1) > 0.02).all() and np.abs(commands).max() <= bluerov2.MOST


def test_what_is_hidden_in_the_rov_shows_in_the_motion_and_not_in_its_commands(rov, monkeypatch):
    bluerov2, run, module, _ = rov
    monkeypatch.setattr(bluerov2, "DURATION", 6.0)
    plain = bluerov2.Plant(module).run(3)
    for name, changed in run.BLUEROV2.changes.items():
        other = bluerov2.Plant(module, **changed).run(3)
        moved = np.abs(other - plain)[:, 5:14].max()
        assert moved > 0.003 if name != "nothing" else moved == 0.0, name
        np.testing.assert_array_equal(other[0, 14:], plain[0, 14:])
    half = len(plain) // 2
    again = bluerov2.Plant(module, **run.BLUEROV2.changes["payload"])
    np.testing.assert_array_equal(again.run(3), again.run(3))
    np.testing.assert_array_equal(again.run(3)[:half], plain[:half])


def test_the_hidden_changes_of_the_rov_are_of_the_size_that_is_told(rov):
    bluerov2, run, module, _ = rov

    def made(name):
        return bluerov2.Plant(module, **run.BLUEROV2.changes[name]).vehicle()

    plain = module.BlueROV2()
    heavier = made("added_mass")
    np.testing.assert_allclose(heavier.MA, 1.5 * plain.MA)
    np.testing.assert_allclose(heavier.Minv @ (plain.MRB + 1.5 * plain.MA), np.eye(6), atol=1e-12)
    assert heavier.Zw_dot == 1.5 * plain.Zw_dot
    # A weak thruster, and one that does less astern, by what each pushes in one step.
    push = np.full(8, 0.5)
    given, weak = (
        plain.compute_thruster_forces(push, 0.01),
        made("thruster_gain").compute_thruster_forces(push, 0.01),
    )
    line = bluerov2.allocation(plain)[:, 2]
    np.testing.assert_allclose(given - weak, 0.4 * line * (given - weak)[0] / (0.4 * line[0]), atol=1e-12)
    np.testing.assert_allclose((given - weak)[0] / line[0], 0.4 * plain.thrust(0.5))
    astern = made("thrust_asymmetry").compute_thruster_forces(-push, 0.01)
    np.testing.assert_allclose(astern, 0.75 * plain.compute_thruster_forces(-push, 0.01))
    # A command that comes ten steps later.
    late = made("actuation_delay")
    forces = [late.compute_thruster_forces(push * (i + 1) / 20, 0.01) for i in range(12)]
    assert not np.any(forces[:10])
    np.testing.assert_allclose(forces[10], plain.compute_thruster_forces(push / 20, 0.01))
    # The load's weight and its moment: 0.5 kg at 0.15 m.
    loaded = module.BlueROV2()
    run.BLUEROV2.changes["payload"]["later"](loaded)
    np.testing.assert_allclose(loaded.W - plain.W, 0.5 * plain.g)
    np.testing.assert_allclose((plain.xb - loaded.xb) * plain.B, 0.15 * 0.5 * plain.g)


def test_the_names_hidden_in_the_rov_are_those_of_the_catalogue(rov):
    study = rov[1].BLUEROV2
    assert {*study.changes, *(n for names in study.also.values() for n in names)} - {"nothing"} <= set(
        EFFECTS.names()
    )


def test_the_page_on_the_rov_tells_what_came_out(rov):
    study = rov[1].BLUEROV2
    text = (HERE / "bluerov2.md").read_text()
    first, other = (
        {r["hidden"]: r for r in json.loads((HERE / f"expected-bluerov2{which}.json").read_text())}
        for which in ("-first", "")
    )
    told = {
        n: cells
        for n, *cells in re.findall(
            r"^\| `?(\w+)`? \| (.*?) \| (.*?) \| [^|]* \| ([\d., ]+) \| ([\d, ]+) \|$", text, re.M
        )
    }
    assert set(told) == set(first) == set(other) == set(study.changes)
    for name, (before, after, errors, seconds) in told.items():
        for row, said in ((first[name], before), (other[name], after)):
            expected = ", then ".join(" or ".join(f"`{e}`" for e in group) for group in row["groups"])
            assert said.replace("**", "") == (expected or row["verdict"]), name
        assert errors == f"{first[name]['error']:.2f}, {other[name]['error']:.2f}"
        assert seconds == f"{first[name]['seconds']:.0f}, {other[name]['seconds']:.0f}"
    for words, rows in (("First logs", first), ("Other logs, by present rules", other)):
        right = {n: {n, *study.also.get(n, ())} for n in rows}
        hits = [r for n, r in rows.items() if n != "nothing" and right[n] & {*(r["groups"] or [[]])[0]}]
        wrong = [r for n, r in rows.items() if r["groups"] and not right[n] & {*r["groups"][0]}]
        alone = sum(len(r["groups"][0]) == 1 for r in hits)
        assert (
            f"- {words}: {len(hits)} of {len(rows) - 1} are named first, {alone} of them alone, and a wrong name comes "
            f"first in {len(wrong)} of {len(rows)}." in text
        )
        assert round(float(np.median([r["seconds"] for r in rows.values()]))) == 99
