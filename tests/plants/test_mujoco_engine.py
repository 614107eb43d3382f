"""The physics engine: what it computes of the fluid, and that plant and nominal model are then the same."""

import sys

import numpy as np
import pytest

from auvnn.errors import ConfigError, MissingExtra
from auvnn.models import GreyBox
from auvnn.plants.mujoco_engine import REFUSED
from auvnn.simulation import simulate
from auvnn.vehicle import load_vehicle
from tests.plants.plant_tasks import apart, move, plausible, task

WATER = 1025.0


def test_without_the_package_there_is_a_hint(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtra, match=r"plant mujoco needs .*pip install 'auvnn\[mujoco\]'"):
        move("mujoco", task())


@pytest.mark.parametrize("name", REFUSED)
def test_what_the_engine_cannot_have_is_refused(name):
    with pytest.raises(ConfigError, match=f"plant mujoco cannot hold the effect {name}.*plant=numpy"):
        simulate(
            GreyBox(load_vehicle("rov95")),
            hidden=[name],
            plant="mujoco",
            runs=1,
            duration=1.0,
            rate=10.0,
            noise="none",
        )


@pytest.fixture
def mujoco():
    return pytest.importorskip("mujoco", reason="the extra 'mujoco' is not installed")


@pytest.fixture
def ellipsoid(mujoco):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option density="{WATER}" viscosity="0" gravity="0 0 0"/>
    <worldbody><body><freejoint/><inertial pos="0 0 0" mass="10" diaginertia="1 2 3"/>
    <geom type="ellipsoid" size="0.3 0.1 0.15" fluidshape="ellipsoid" fluidcoef="0 0 0 0 0" mass="0"
    contype="0" conaffinity="0"/></body></worldbody></mujoco>""")
    return model, mujoco.MjData(model)


def test_the_engine_gives_no_force_by_acceleration(mujoco, ellipsoid):
    model, data = ellipsoid
    data.qfrc_applied[:] = [1, 2, 3, 0.1, 0.2, 0.3]
    mujoco.mj_forward(model, data)
    assert data.qacc == pytest.approx([0.1, 0.2, 0.3, 0.1, 0.1, 0.1], rel=1e-12)
    assert model.geom_fluid[0, 6:].min() * WATER > 0.01


def test_the_engine_gives_the_coriolis_forces_of_added_mass_in_the_current(mujoco, ellipsoid):
    model, data = ellipsoid
    added = np.array([4.0, 50.0, 70.0, 1.0, 9.0, 7.0])
    model.geom_fluid[0, 6:] = added / WATER
    model.opt.wind[:] = [0.2, -0.1, 0.05]
    data.qvel[:] = [0.5, -0.3, 0.2, 0.1, 0.4, -0.2]
    mujoco.mj_forward(model, data)
    flow, turn = data.qvel[:3] - model.opt.wind, data.qvel[3:]
    p, m = added[:3] * flow, added[3:] * turn
    expected = [-np.cross(turn, p), -np.cross(turn, m) - np.cross(flow, p)]
    assert data.qfrc_passive == pytest.approx(np.concatenate(expected), rel=1e-12)


def test_only_its_rk4_is_more_than_first_order(mujoco, ellipsoid):
    model, data = ellipsoid
    ends = {}
    for kind in ("EULER", "IMPLICIT", "IMPLICITFAST", "RK4"):
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{kind}")
        for steps in (100, 200, 1600):
            mujoco.mj_resetData(model, data)
            data.qvel[:] = [0.5, -0.3, 0.2, 0.1, 0.4, -0.2]
            model.opt.timestep = 1.0 / steps
            mujoco.mj_step(model, data, steps)
            ends[kind, steps] = data.qvel.copy()
    exact = ends["RK4", 1600]
    for kind in ("EULER", "IMPLICIT", "IMPLICITFAST", "RK4"):
        coarse, fine = (np.abs(ends[kind, n] - exact).max() for n in (100, 200))
        if kind == "RK4":
            assert coarse < 1e-6 and coarse / fine > 10
        else:
            assert coarse > 1e-3 and coarse / fine < 4


@pytest.mark.parametrize("vehicle", ["rov95", "bluerov2_heavy", "remus100"])
def test_nominal_vehicles_move_as_in_numpy(mujoco, vehicle):
    # Its RK4 at a fixed step against an adaptive method: corners of |nu| nu and of thrust tables are what is left.
    what = task(vehicle)
    assert apart(move("mujoco", what), move("numpy", what)) < 2e-6


@pytest.mark.parametrize("names", [
    ("ocean_current", "cg_offset", "trapped_water", "added_mass", "net_buoyancy"),
    ("ocean_current", "drag_only_current", "added_mass", "body_lift", "body_lift_stall"),
    ("thruster_lag", "actuation_delay", "tether", "constant_force", "velocity_lever_arm", "coupled_damping"),
])  # fmt: skip
def test_effects_move_as_in_numpy(mujoco, names):
    what = task(
        "remus100", {n: plausible(n, "remus100") for n in names}, {"stranger_layers": {"strength": 1.0}}
    )
    assert apart(move("mujoco", what), move("numpy", what)) < 2e-6


def test_the_callback_is_taken_back(mujoco):
    move("mujoco", task(rows=3))
    assert mujoco.get_mjcb_control() is None
