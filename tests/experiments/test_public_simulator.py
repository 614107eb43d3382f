"""The study on public simulators: its logs and its models, by a stand-in with the interface of the REMUS 100."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import auvnn
from auvnn.effects import EFFECTS
from tests.experiments.public_simulators import HERE, studied

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
    with studied(checkout / "src") as run:
        import remus

        yield remus, run, remus.simulator(checkout)


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
