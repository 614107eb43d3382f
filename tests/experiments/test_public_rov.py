"""The study on public simulators: its logs and names, by a stand-in with the interface of the BlueROV2 Heavy."""

from __future__ import annotations

import numpy as np
import pytest

import auvnn
from auvnn.effects import EFFECTS
from tests.experiments.public_simulators import shows_in_the_motion_alone, studied, told_is_what_came_out

# A vehicle with the interface of the simulator's class, and numbers of our own: masses, linear drag, buoyancy, and thrust
# that grows with the square of the command.
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


@pytest.fixture(scope="module")
def rov(tmp_path_factory):
    """The study's modules, and a checkout with a stand-in for that simulator."""
    checkout = tmp_path_factory.mktemp("rov")
    (checkout / "fossen").mkdir()
    (checkout / "fossen" / "BlueROV2.py").write_text(ROV)
    with studied(checkout / "fossen") as run:
        import bluerov2

        yield bluerov2, run, bluerov2.simulator(checkout), checkout


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
    shows_in_the_motion_alone(run.BLUEROV2, module)


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
    told_is_what_came_out(
        rov[1].BLUEROV2,
        "bluerov2",
        {"First logs": "-first", "Logs of `seed=150`": "-150", "Logs of `seed=250`": "-250"},
    )
