"""The study on public simulators: its logs and names, by a stand-in with the interface of COLA2's Girona 500."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

import auvnn
from auvnn.effects import EFFECTS
from tests.experiments.public_simulators import shows_in_the_motion_alone, studied, told_is_what_came_out

# A vehicle with the interface of the simulator's class, and numbers of our own, with the simplest steps.
GIRONA = """
import rospy
from cola2_lib.rosutils import param_loader
from cola2_lib.utils.angles import wrap_angle
import numpy as np

class Dynamics:
    def __init__(self, name):
        param_loader.get_ros_params(self, {
            "mass": ("mass", 80.0), "buoyancy": ("buoyancy", 81.0), "g": ("g", 9.8), "density": ("density", 1000.0),
            "gravity_center": ("gravity_center", [0.0, 0.0, 0.04]), "period": ("period", 0.01),
            "max_thrusters_rpm": ("max_thrusters_rpm", 1000.0), "ctf": ("ctf", 1e-4), "ctb": ("ctb", 8e-5),
            "tensor": ("tensor", [7.0, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 9.0]),
            "damping": ("damping", [-5.0, -50.0, -5.0, -90.0, -90.0, -90.0]),
            "quadratic_damping": ("quadratic_damping", [-90.0, -120.0, -130.0, -60.0, -60.0, -60.0]),
            "thrusters_matrix": ("thrusters_matrix", [[-1, -1, 0, 0, 0], [0, 0, 0, 0, 1], [0, 0, -1, -1, 0],
                                                      [0, 0, 0, 0, 0], [0, 0, 0.3, -0.3, 0], [-0.5, 0.5, 0, 0, 0]]),
        })
        self.thrusters_matrix = np.array(self.thrusters_matrix, float)
        lever = 80.0 * 0.04
        self.M = np.diag([120.0, 120.0, 120.0, 7.0, 8.0, 9.0])
        self.M[0, 4] = self.M[4, 0] = lever
        self.M[1, 3] = self.M[3, 1] = -lever
        self.IM = np.linalg.inv(self.M)
        self.u = self.old_u = np.zeros(5)
        self.f = np.zeros(0)

    def update_thrusters(self, message):
        self.old_u, self.u = self.u, np.array(message.setpoints)

    def compute_currents(self):
        return np.zeros(6)

    def damping_matrix(self, speed):
        return np.diag(np.array(self.damping) + np.array(self.quadratic_damping) * abs(speed))

    def gravity(self, pos):
        weight, up, (roll, pitch) = self.mass * self.g, self.buoyancy * self.g, pos[3:5]
        down = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
        return -np.array([*((weight - up) * down), *np.cross([0.0, 0.0, 0.04], weight * down)])

    def inverse_dynamic(self, pos, vel, u, f, current):
        push = self.thrusters_matrix @ (np.where(u > 0, self.ctf, self.ctb) * u * abs(u))
        linear, angular = self.M[:3] @ vel, self.M[3:] @ vel
        turning = np.array([*np.cross(vel[3:], linear), *(np.cross(vel[:3], linear) + np.cross(vel[3:], angular))])
        drag = self.damping_matrix(vel + current) @ (vel + current)
        return np.asarray(self.IM @ (push + drag - turning - self.gravity(pos))).ravel()

    def iterate(self):
        c, s = np.cos(self.p[5]), np.sin(self.p[5])
        moved = np.array([c * self.v[0] - s * self.v[1], s * self.v[0] + c * self.v[1], *self.v[2:]])
        force = self.inverse_dynamic(self.p, self.v, (self.u + self.old_u) / 2, self.f, self.compute_currents())
        self.p, self.v = self.p + self.period * moved, self.v + self.period * force
        self.p[5] = wrap_angle(self.p[5])
        self.pub_odometry()

    def pub_odometry(self):
        rospy.publish(self.p)
"""


@pytest.fixture(scope="module")
def girona(tmp_path_factory):
    """The study's modules, and a checkout with a stand-in for that simulator."""
    checkout = tmp_path_factory.mktemp("girona")
    (checkout / "cola2_sim" / "src").mkdir(parents=True)
    (checkout / "cola2_sim" / "src" / "dynamics.py").write_text(GIRONA)
    with studied() as run:
        import girona500

        yield girona500, run, girona500.simulator(checkout), checkout


def test_the_checkout_tells_that_it_is_the_girona(girona, tmp_path):
    girona500, run, _, checkout = girona
    assert run.study_of(checkout) is run.GIRONA500
    with pytest.raises(SystemExit, match=r"no cola2_sim/src/dynamics\.py"):
        girona500.simulator(tmp_path)
    # Nothing is left of what stood in for ROS while the class was imported.
    assert not {*girona500.ROS} & {*sys.modules}


@pytest.mark.parametrize(
    ("name", "value"),
    [("thrusters_matrix", np.eye(6)), ("quadratic_damping", [90.0] * 6), ("M", 2 * np.eye(6) * 80.0)],
)
def test_another_version_of_the_girona_is_refused(girona, monkeypatch, name, value):
    girona500, _, module, checkout = girona
    vehicle = module.Dynamics("g500")
    assert girona500._is_known(vehicle)
    setattr(vehicle, name, value)
    assert not girona500._is_known(vehicle)
    monkeypatch.setattr(girona500, "_is_known", lambda vehicle: False)
    with pytest.raises(SystemExit, match=f"another version of the vehicle; git checkout {girona500.COMMIT}"):
        girona500.simulator(checkout)


def test_the_model_file_of_the_girona_has_the_forces_of_its_class(girona, tmp_path):
    girona500, run, module, _ = girona
    vehicle = module.Dynamics("g500")
    model = auvnn.load(run.GIRONA500.given(vehicle, tmp_path))
    # Two ways to write the same equations; thrust ahead and astern is another one in the stand-in.
    vehicle.ctb = vehicle.ctf
    assert max(girona500.disagreement(vehicle, model)) < 1e-9
    vehicle.damping = [-5.0, -60.0, -5.0, -90.0, -90.0, -90.0]
    off = girona500.disagreement(vehicle, model)
    assert off[1] > 0.01 and max(off[:1] + off[2:]) < 1e-9


def test_a_run_of_the_girona_is_a_log_that_the_package_reads(girona, tmp_path, monkeypatch):
    girona500, _, module, _ = girona
    monkeypatch.setattr(girona500, "DURATION", 4.0)
    log = auvnn.Log.read(girona500.Plant(module).write(tmp_path / "log.parquet", 1))
    assert [len(r.t) for r in log.runs] == [81] * 3
    commands = np.stack([log[f"thruster_{i + 1}"] for i in range(5)])
    assert (commands.std(1) > 0.02).all() and np.abs(commands).max() <= girona500.MOST
    # Set points change every 0.1 s, every second row.
    first = np.stack([log.runs[0][f"thruster_{i + 1}"] for i in range(5)])
    np.testing.assert_array_equal(first[:, 1::2], first[:, 0:-1:2])
    assert (first[:, 2::2] != first[:, 0:-2:2]).any()


def test_what_is_hidden_in_the_girona_shows_in_the_motion_and_not_in_its_commands(girona, monkeypatch):
    girona500, run, module, _ = girona
    monkeypatch.setattr(girona500, "DURATION", 6.0)
    shows_in_the_motion_alone(run.GIRONA500, module)


MORE = {"X": 260 / 90, "Y": 260 / 120, "Z": 2.0, **dict.fromkeys("KMN", 3.0)}
# With the coefficients as they are, a curve of power 1.6 is that of the effect, whose curves meet at v0, and a factor.
FASTER = dict.fromkeys("XYZ", (0.16 * np.sqrt(9.8 * 1.5)) ** -0.4)


@pytest.mark.parametrize(
    ("name", "effects", "off"),
    [
        ("net_buoyancy", {"net_buoyancy": {"force": 0.8 * 9.8}}, 1e-9),
        ("added_mass", {"added_mass": {"X": 1.5, "Y": 1.5, "Z": 1.5}}, 1e-9),
        # The class's water moves along at the origin, that of the effect at the centre of gravity.
        ("trapped_water", {"trapped_water": {"mass": 12.0}}, 0.03),
        ("quadratic_damping", {"quadratic_damping": MORE}, 1e-9),
        ("drag_curve", {"drag_curve": dict.fromkeys("XYZ", 1.6), "quadratic_damping": FASTER}, 1e-9),
        # The class's tensor about its origin stays what it was.
        ("cg_offset", {"cg_offset": {"x": 0.005}}, 0.003),
    ],
)
def test_what_is_hidden_in_the_girona_is_what_the_effect_of_that_name_says(
    girona, tmp_path, name, effects, off
):
    girona500, run, module, _ = girona
    plain, changed = module.Dynamics("g500"), module.Dynamics("g500")
    plain.ctb = changed.ctb = plain.ctf
    run.GIRONA500.changes[name]["change"](changed)
    model = auvnn.load(run.GIRONA500.given(plain, tmp_path))
    assert max(girona500.disagreement(changed, model)) > max(0.004, 2 * off)
    assert max(girona500.disagreement(changed, model.with_effects(effects))) < off


def test_what_is_hidden_of_the_gironas_thrust_and_time_is_of_the_size_that_is_told(girona):
    girona500, run, module, _ = girona
    changes, plain = run.GIRONA500.changes, module.Dynamics("g500")

    def made(name):
        return girona500.Plant(module, **changes[name]).vehicle()

    def pushed(vehicle, command):
        still = np.zeros(6)
        both = (vehicle.inverse_dynamic(still, still, u, vehicle.f, still) for u in (command, np.zeros(5)))
        return plain.M @ np.subtract(*both)

    each = np.eye(5) * 500.0
    for i, command in enumerate(each):
        np.testing.assert_allclose(
            pushed(made("thruster_gain"), command),
            (0.7 if i == 1 else 1.0) * pushed(plain, command),
            atol=1e-9,
        )
        np.testing.assert_allclose(
            pushed(made("thrust_asymmetry"), -command), 0.75 * pushed(plain, -command), atol=1e-9
        )
    # Set points that come fifteen steps later, and ones that are followed by a lag of 0.3 s.
    late, slow = made("actuation_delay"), made("thruster_lag")
    seen = {}
    for vehicle in (late, slow):
        vehicle.p, vehicle.v = np.array([0.0, 0, 5, 0, 0, 0]), np.zeros(6)
        vehicle.update_thrusters(SimpleNamespace(setpoints=each[0]))
        vehicle.update_thrusters(SimpleNamespace(setpoints=each[0]))
        given, seen[id(vehicle)] = vehicle.inverse_dynamic, []

        def noted(p, v, u, *more, given=given, turns=seen[id(vehicle)]):  # noqa: B008 - of this vehicle
            turns.append(u)
            return given(p, v, u, *more)

        vehicle.inverse_dynamic = noted
        for _ in range(30):
            vehicle.iterate()
    turns = [[u[0] for u in seen[id(v)]] for v in (late, slow)]
    assert turns[0][:15] == [0.0] * 15 and turns[0][15:] == [500.0] * 15
    ends = 500.0 * (1.0 - np.exp(-np.arange(31) * 0.01 / 0.3))
    np.testing.assert_allclose(turns[1], (ends[1:] + ends[:-1]) / 2, rtol=1e-9)
    # Three kilograms at 0.3 m, in a vehicle that stands level.
    loaded, still = module.Dynamics("g500"), np.zeros(6)
    changes["payload"]["later"](loaded)
    more = loaded.gravity(still) - plain.gravity(still)
    np.testing.assert_allclose(more, [0, 0, -3.0 * plain.g, 0, 0.9 * plain.g, 0], atol=1e-12)
    np.testing.assert_allclose((loaded.M - plain.M)[2], [0, 0, 3.0, 0, -0.9, 0])


def test_the_current_of_the_girona_is_the_same_water_whatever_the_heading(girona):
    girona500, run, module, _ = girona
    vehicle = girona500.Plant(module, **run.GIRONA500.changes["ocean_current"]).vehicle()
    for heading in (0.0, 0.5 * np.pi, np.pi):
        vehicle.p = np.array([0.0, 0.0, 5.0, 0.0, 0.0, heading])
        c, s = np.cos(heading), np.sin(heading)
        # The class adds it to the speed: water that moves north at 0.15 m/s comes from ahead of a vehicle that backs.
        x, y = vehicle.compute_currents()[:2]
        np.testing.assert_allclose([c * x - s * y, s * x + c * y], [-0.15, 0.1], atol=1e-12)


def test_the_names_hidden_in_the_girona_are_those_of_the_catalogue(girona):
    study = girona[1].GIRONA500
    assert {*study.changes, *(n for names in study.also.values() for n in names)} - {"nothing"} <= set(
        EFFECTS.names()
    )


def test_the_page_on_the_girona_tells_what_came_out(girona):
    told_is_what_came_out(
        girona[1].GIRONA500, "girona500", {"First logs": "-first", "Other logs, by later rules": ""}
    )
