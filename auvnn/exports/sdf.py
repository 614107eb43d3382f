"""gz-sim: the vehicle as an SDF model with the Hydrodynamics, Thruster and LiftDrag systems."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np
import torch

from auvnn.answers import write_text
from auvnn.exports.base import Target, Written
from auvnn.exports.drag_terms import Terms, fitted
from auvnn.exports.origin import ORIGIN
from auvnn.exports.system import System
from auvnn.models import GreyBox
from auvnn.vehicle.parts import ThrustTable

FLU = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""Signs of velocities and forces in gz-sim's body frame (x forward, y to port, z up)."""
AXES, VELOCITIES, SECOND = "xyzkmn", "UVWPQR", "xyzpqr"
NAMESPACE = "urn:auvnn"
LIGHT = "0.0001"
"""kg: links of thrusters and fins cannot be without mass."""


class SdfTarget(Target):
    """model.sdf and model.config."""

    name = "sdf"
    summary = "gz-sim SDF: added mass, drag, buoyancy, thrusters, fins"

    def write(self, system: System, folder: Path, precision: str) -> Written:
        """Write model.sdf and model.config."""
        model, terms = system.model, fitted(system.model)
        root = document(model, terms)
        xml.indent(root)
        text = '<?xml version="1.0"?>\n' + xml.tostring(root, encoding="unicode") + "\n"
        write_text(folder / "model.sdf", text)
        config = xml.Element("model")
        for key, value in (("name", model.vehicle.name), ("version", "1.0")):
            xml.SubElement(config, key).text = value
        xml.SubElement(config, "sdf", {"version": "1.11"}).text = "model.sdf"
        xml.SubElement(config, "description").text = f"written by {ORIGIN}"
        xml.indent(config)
        write_text(folder / "model.config", xml.tostring(config, encoding="unicode") + "\n")
        return Written(lost(model, terms), notes(model))


def lost(model: GreyBox, terms: Terms) -> list[str]:
    """Return what gz-sim has no form for."""
    found = []
    learned = [n for n, has in (("damping elements", bool(model.vehicle.damping_elements)),
                                ("learned damping", model.learned_parts()[1] is not None)) if has]  # fmt: skip
    if terms.error > 1e-6:
        names = ", ".join([*learned, *terms.effects]) or "drag"
        found.append(
            f"{names}: only as the nearest linear and quadratic terms, off by {100 * terms.error:.2g} % rms"
        )
    held = {"ocean_current", "thruster_gain", *terms.effects}
    for effect in model.members:
        hooks = set(effect.hooks())
        if effect.name in held or effect.absent() or (hooks == {"body"} and not effect.time_varying):
            continue
        found.append(f"{effect.name}: gz-sim has no such effect ({effect.cause})")
    if model.actuation == "thrusters" and any(
        isinstance(u.curve, ThrustTable) for u in model.vehicle.thrusters
    ):
        found.append("thrust tables: gz-sim's thrusters take newtons; look the thrust up before sending it")
    if model.vehicle.fins:
        found.append("fins: their lift is cut off at the stall angle, without the smooth stall of the model")
    return found


def notes(model: GreyBox) -> list[str]:
    """Return what a user of the file should know."""
    added, rigid = np.diag(model.vehicle.added_mass), np.diag(model.vehicle.rigid_body)
    found = [
        "the simulator needs the Buoyancy system in its world, with the water's density, and DART for the added mass"
    ]
    if (added > rigid).any():
        found.append(
            "added mass exceeds the rigid body's: it is written as <fluid_added_mass>, which the engine solves for; "
            "moved into the plugin (xDotU ...) the simulation would be unstable"
        )
    return found


def document(model: GreyBox, terms: Terms) -> xml.Element:
    """Return the SDF document."""
    xml.register_namespace("auvnn", NAMESPACE)
    vehicle = model.vehicle
    with torch.no_grad():
        body = (model if not model.time_varying else model.rebuilt([])).prepare().body
    b: dict[str, Any] = {
        n: getattr(body, n).numpy()
        for n in ("mass", "buoyancy", "weight", "hangs", "cg", "cb", "inertia", "added_mass")
    }
    root = xml.Element("sdf", {"version": "1.11"})
    main = xml.SubElement(root, "model", {"name": vehicle.name})
    for key in ("gravity", "water_density", "length", "reference_voltage"):
        if getattr(vehicle, key) is not None:
            _own(main, key, repr(float(getattr(vehicle, key))))
    link = xml.SubElement(main, "link", {"name": "base_link"})
    inertial = xml.SubElement(link, "inertial")
    _text(inertial, "pose", [*(FLU[:3] * b["cg"]), 0, 0, 0])
    _text(inertial, "mass", [b["mass"]])
    turn = np.diag(FLU[:3])
    moments = xml.SubElement(inertial, "inertia")
    tensor = turn @ b["inertia"] @ turn
    for i, first in enumerate("xyz"):
        for j in range(i, 3):
            _text(moments, f"i{first}{'xyz'[j]}", [tensor[i, j]])
    added = xml.SubElement(inertial, "fluid_added_mass")
    matrix = FLU[:, None] * b["added_mass"] * FLU
    for i in range(6):
        for j in range(i, 6):
            _text(added, SECOND[i] + SECOND[j], [matrix[i, j]])
    # The simulator's weight is mass times gravity at the centre of gravity: what else hangs on the body, and where,
    # goes into displaced volume and its centre, so that force and moment are the same in every attitude.
    weight = float(b["mass"]) * vehicle.gravity
    lift = float(b["buoyancy"]) - (float(b["weight"]) - weight)
    centre = b["cb"]
    if lift != float(b["buoyancy"]):
        centre = (weight * b["cg"] - b["weight"] * b["hangs"] + b["buoyancy"] * b["cb"]) / lift
    side = (lift / (vehicle.water_density * vehicle.gravity)) ** (1 / 3)
    hull = xml.SubElement(link, "collision", {"name": "displaced_volume"})
    _text(hull, "pose", [*(FLU[:3] * centre), 0, 0, 0])
    _text(xml.SubElement(xml.SubElement(hull, "geometry"), "box"), "size", [side, side, side])
    _hydrodynamics(main, model, body, terms)
    if model.actuation == "thrusters":
        _thrusters(main, model)
    for k, fin in enumerate(vehicle.fins):
        _fin(main, k + 1, fin, vehicle.water_density)
    return root


def _own(parent: xml.Element, key: str, text: str) -> None:
    xml.SubElement(parent, f"{{{NAMESPACE}}}{key}").text = text


def _text(parent: xml.Element, key: str, values: Any) -> None:
    # Adding zero makes -0.0 a plain 0.0.
    xml.SubElement(parent, key).text = " ".join(repr(float(v) + 0.0) for v in values)


def _hydrodynamics(main: xml.Element, model: GreyBox, body: Any, terms: Terms) -> None:
    plugin = xml.SubElement(
        main, "plugin", {"filename": "gz-sim-hydrodynamics-system", "name": "gz::sim::systems::Hydrodynamics"}
    )
    xml.SubElement(plugin, "link_name").text = "base_link"
    linear, absolute = terms.linear.copy(), terms.absolute.copy()
    if body.linear is not None:
        linear -= body.linear.numpy()
    if body.quadratic is not None:
        for j in range(6):
            absolute[:, j, j] -= body.quadratic.numpy()[:, j]
    for i in range(6):
        for j in range(6):
            _term(plugin, AXES[i] + VELOCITIES[j], FLU[i] * FLU[j] * linear[i, j])
            for k in range(6):
                name = f"{AXES[i]}{VELOCITIES[j]}"
                _term(plugin, f"{name}abs{VELOCITIES[k]}", FLU[i] * FLU[j] * absolute[i, j, k])
                _term(plugin, name + VELOCITIES[k], FLU[i] * FLU[j] * FLU[k] * terms.plain[i, j, k])
    for effect in model.members:
        if effect.name == "ocean_current":
            v = effect.values()
            _text(plugin, "default_current", [v["v_east"], v["v_north"], -v["v_down"]])


def _term(plugin: xml.Element, name: str, value: float) -> None:
    if value != 0.0:
        _text(plugin, name, [value])


def _thrusters(main: xml.Element, model: GreyBox) -> None:
    gains = next((e.theta.tolist() for e in model.members if e.name == "thruster_gain"), None)
    for k, unit in enumerate(model.vehicle.thrusters):
        name, gain = f"thruster_{k + 1}", 1.0 if gains is None else gains[k]
        _part(main, name, unit.position, unit.direction, None)
        plugin = xml.SubElement(
            main, "plugin", {"filename": "gz-sim-thruster-system", "name": "gz::sim::systems::Thruster"}
        )
        xml.SubElement(plugin, "namespace").text = model.vehicle.name
        xml.SubElement(plugin, "joint_name").text = f"{name}_joint"
        _text(plugin, "fluid_density", [model.vehicle.water_density])
        _text(plugin, "propeller_diameter", [0.1])
        _text(plugin, "max_thrust_cmd", [gain * unit.max_forward])
        _text(plugin, "min_thrust_cmd", [-gain * unit.max_reverse])
        # Else a controller turns the blades by torque, with a gain that is far too high for a link so light.
        xml.SubElement(plugin, "velocity_control").text = "true"
        _own(plugin, "handedness", str(unit.handedness))
        if isinstance(unit.curve, ThrustTable):
            _own(plugin, "command", " ".join(map(repr, unit.curve.command.tolist())))
            _own(plugin, "thrust", " ".join(map(repr, (gain * unit.curve.thrust).tolist())))


def _part(main: xml.Element, name: str, place: Any, axis: Any, limit: float | None) -> None:
    """Write a light link and the joint by which it turns."""
    link = xml.SubElement(main, "link", {"name": name})
    _text(link, "pose", [*(FLU[:3] * np.asarray(place)), 0, 0, 0])
    inertial = xml.SubElement(link, "inertial")
    xml.SubElement(inertial, "mass").text = LIGHT
    moments = xml.SubElement(inertial, "inertia")
    for i in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        xml.SubElement(moments, i).text = "1e-07" if i[1] == i[2] else "0"
    joint = xml.SubElement(main, "joint", {"name": f"{name}_joint", "type": "revolute"})
    xml.SubElement(joint, "parent").text = "base_link"
    xml.SubElement(joint, "child").text = name
    turning = xml.SubElement(joint, "axis")
    _text(turning, "xyz", FLU[:3] * np.asarray(axis))
    bounds = xml.SubElement(turning, "limit")
    _text(bounds, "lower", [-(limit or 1e16)])
    _text(bounds, "upper", [limit or 1e16])


def _fin(main: xml.Element, number: int, fin: Any, density: float) -> None:
    name = f"fin_{number}"
    _part(main, name, fin.position, fin.axis, 1.0)
    control = xml.SubElement(main, "plugin", {
        "filename": "gz-sim-joint-position-controller-system", "name": "gz::sim::systems::JointPositionController",
    })  # fmt: skip
    xml.SubElement(control, "joint_name").text = f"{name}_joint"
    plugin = xml.SubElement(
        main, "plugin", {"filename": "gz-sim-lift-drag-system", "name": "gz::sim::systems::LiftDrag"}
    )
    xml.SubElement(plugin, "link_name").text = name
    axis = np.asarray(fin.axis)
    chord = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    chord = chord / np.linalg.norm(chord)
    for key, value in (
        ("air_density", density), ("area", fin.area), ("a0", 0.0), ("cla", fin.lift_slope), ("cda", 0.0),
        ("alpha_stall", fin.stall), ("cla_stall", 0.0), ("cda_stall", 0.0),
    ):  # fmt: skip
        _text(plugin, key, [value])
    _text(plugin, "cp", [0, 0, 0])
    _text(plugin, "forward", FLU[:3] * chord)
    # A positive angle takes the leading edge towards axis x chord, and the lift goes there.
    _text(plugin, "upward", FLU[:3] * np.cross(axis, chord))
