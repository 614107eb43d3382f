"""gz-sim SDF: what is written comes back, means what the model means, and what is lost is said."""

from __future__ import annotations

import re
from xml.etree import ElementTree as xml

import numpy as np
import pytest
import torch

from auvnn import import_model
from auvnn.errors import ConfigError
from auvnn.exports import export
from auvnn.models import Inputs
from auvnn.physics.attitude import euler_to_quat, quat_to_matrix
from tests.exports.cases import LAG, VEHICLES, model

FLU = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
NUMBERS = ("mass", "buoyancy", "gravity", "water_density", "length", "center_of_gravity", "center_of_buoyancy", "inertia",
           "added_mass", "linear_damping", "quadratic_damping")  # fmt: skip


def same(mine, theirs, elements=False):
    a, b = mine.to_dict(), theirs.to_dict()
    for key in NUMBERS:
        if elements and "damping" in key:
            continue
        assert (key in a) == (key in b), key
        if key in a:
            assert np.allclose(np.array(a[key]), np.array(b[key]), rtol=1e-12, atol=1e-13), key
    for kind in ("thrusters", "fins"):
        for one, other in zip(a.get(kind, []), b.get(kind, []), strict=True):
            for key in one:
                if key == "curve":
                    assert one[key] == other[key]
                else:
                    assert np.allclose(one[key], other[key], rtol=1e-12, atol=1e-15), key


@pytest.mark.parametrize("name", VEHICLES)
def test_a_vehicle_comes_back(tmp_path, name):
    own = model(name)
    export(own, "sdf", tmp_path / "out")
    found = import_model(tmp_path / "out" / "model.sdf")
    same(own.vehicle, found.vehicle, elements=bool(own.vehicle.damping_elements))
    if not own.vehicle.damping_elements:
        assert found.unread == ()
    found.save(tmp_path / "model.yaml")
    from auvnn.models import load

    same(load(tmp_path / "model.yaml").vehicle, found.vehicle)


def test_what_gz_itself_reads_says_the_same(tmp_path):
    """Without our own elements, which the simulator does not see."""
    export(model("remus100"), "sdf", tmp_path / "out")
    text = (tmp_path / "out" / "model.sdf").read_text()
    plain = re.sub(r"<auvnn:(\w+)>[^<]*</auvnn:\1>", "", text)
    assert "auvnn:" not in plain.replace('xmlns:auvnn="urn:auvnn"', "")
    water = "<plugin><uniform_fluid_density>1030</uniform_fluid_density></plugin>"
    world = f"<sdf><world><gravity>0 0 -9.81</gravity>{water}</world>{plain[plain.index('<sdf') :]}</sdf>"
    (tmp_path / "plain.sdf").write_text(world)
    found, own = import_model(tmp_path / "plain.sdf").vehicle, model("remus100").vehicle
    for key in ("mass", "buoyancy", "inertia", "added_mass", "quadratic_damping"):
        assert np.allclose(getattr(found, key), getattr(own, key), rtol=1e-12, atol=1e-13)


def forces(plugin, nu):
    """Return the wrench of the Hydrodynamics system's drag at velocities in gz's axes, as its source sums it."""
    out = np.zeros_like(nu)
    for element in plugin:
        match = re.fullmatch("([xyzkmn])([UVWPQR])(abs)?([UVWPQR])?", element.tag)
        if match:
            i, j = "xyzkmn".index(match[1]), "UVWPQR".index(match[2])
            second = 1.0 if match[4] is None else nu[:, "UVWPQR".index(match[4])]
            out[:, i] += float(element.text) * nu[:, j] * (np.abs(second) if match[3] else second)
    return out


@pytest.mark.parametrize("name", ["bluerov2", "remus100", "rov95", "networks"])
def test_the_drag_of_the_terms_is_that_of_the_model(tmp_path, name):
    own = model(name)
    out = export(own, "sdf", tmp_path / "out")
    plugin = next(
        p for p in xml.parse(tmp_path / "out" / "model.sdf").iter("plugin") if p.find("link_name") is not None
    )
    random = np.random.default_rng(1)
    nu = random.uniform(-1, 1, (400, 6)) * np.array([1.5, 0.75, 0.75, 0.75, 0.75, 0.75])
    level = quat_to_matrix(euler_to_quat(torch.zeros(400, 3, dtype=torch.float64)))
    zero = torch.zeros(400, own.actuators.size, dtype=torch.float64)
    with torch.no_grad():
        terms = own.wrenches(
            torch.zeros(400, 3, dtype=torch.float64), level, torch.tensor(nu), zero, Inputs(zero), zero[:, 0]
        )
    drag = sum(w.numpy() for n, w in terms.items() if "damping" in n)
    error = np.sqrt(((FLU * forces(plugin, FLU * nu) - drag) ** 2).mean(0)) / np.sqrt((drag**2).mean(0))
    said = next((float(m[1]) for w in out.lost if (m := re.search(r"off by ([\d.e+-]+) %", w))), 0.0)
    assert error.max() < max(1e-9, 1.3 * said / 100), (error, said)
    assert said < 15


def test_what_is_lost_is_said_and_strict_refuses(tmp_path):
    own = model("rov90").with_effects({
        **LAG, "ocean_current": {"v_north": 0.3, "v_east": 0.1}, "net_buoyancy": {"force": 4.0}, "cg_offset": {"x": 0.01},
        "body_lift": {"Yuv": 5.0},
    })  # fmt: skip
    out = export(own, "sdf", tmp_path / "out")
    assert [w.split(":")[0] for w in out.lost] == ["thruster_lag"]
    found = import_model(tmp_path / "out" / "model.sdf").vehicle
    assert found.effects == {"ocean_current": {"v_north": 0.3, "v_east": 0.1, "v_down": 0.0}}
    body = own.prepare().body
    assert np.isclose(found.buoyancy - found.weight, float(body.buoyancy - body.weight), rtol=1e-9)
    assert np.allclose(found.center_of_gravity, body.cg.detach().numpy())
    moment = found.weight * found.center_of_gravity - found.buoyancy * found.center_of_buoyancy
    assert np.allclose(
        moment, (body.weight * body.hangs - body.buoyancy * body.cb).detach().numpy(), atol=1e-9
    )
    text = (tmp_path / "out" / "model.sdf").read_text()
    # A product of two velocities is one of gz's terms: Y = - Yuv u v turned to port.
    assert re.search(r"<yUV>|<yVU>", text)
    with pytest.raises(ConfigError, match="strict=true and to=sdf loses something: thruster_lag"):
        export(own, "sdf", tmp_path / "strict", strict=True)
    assert not (tmp_path / "strict").exists()


def test_fins_turn_and_lift_the_right_way(tmp_path):
    """A stern plane's positive angle lifts the stern: in gz's axes the lift goes up, and the leading edge too."""
    export(model("remus100"), "sdf", tmp_path / "out")
    root = xml.parse(tmp_path / "out" / "model.sdf").getroot()
    plugin = next(p for p in root.iter("plugin") if p.findtext("link_name") == "fin_3")
    axis = next(j for j in root.iter("joint") if j.get("name") == "fin_3_joint").findtext("axis/xyz")
    texts = (axis, plugin.findtext("forward"), plugin.findtext("upward"))
    turn, forward, upward = (np.array([float(v) for v in t.split()]) for t in texts)
    assert np.allclose(turn, [0, -1, 0]) and np.allclose(forward, [1, 0, 0])
    assert np.allclose(np.cross(turn, forward), upward) and np.allclose(upward, [0, 0, 1])
