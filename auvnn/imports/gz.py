"""gz-sim SDF: a model with the Hydrodynamics system."""

from __future__ import annotations

import re
from itertools import product
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from auvnn.errors import InputError
from auvnn.imports.tree import Reader, turned

FLU = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
AXES, VELOCITIES, SECOND = "xyzkmn", "UVWPQR", "xyzpqr"
OWN = "{urn:auvnn}"
SETTINGS = {
    "link_name",
    "default_current",
    "namespace",
    "water_density",
    "disable_coriolis",
    "disable_added_mass",
}


class GzSource:
    """Reads gz-sim's vehicles; forces are + coefficient times velocity, in axes x forward, y to port, z up."""

    def knows(self, root: xml.Element) -> bool:
        """Return whether the file states hydrodynamics in gz-sim's way."""
        return self._plugin(root) is not None

    def _plugin(self, root: xml.Element) -> xml.Element | None:
        return next(
            (p for p in root.iter("plugin") if "ydrodynamics" in (p.get("name") or "").split("::")[-1]), None
        )

    def read(self, root: xml.Element, reader: Reader) -> dict[str, Any]:
        """Return the mapping of a model file."""
        plugin = self._plugin(root)
        assert plugin is not None
        model = next((m for m in root.iter("model") if plugin in list(m)), root)
        wanted = (plugin.findtext("link_name") or "").strip()
        link = next((k for k in model.iter("link") if k.get("name") == wanted), None)
        if link is None:
            raise InputError(
                f"{reader.where}: there is no link '{wanted}', to which the hydrodynamics belong"
            )
        density, gravity = self._water(root, model, reader)
        mass = reader.number(link, "inertial/mass")
        pose = reader.numbers(link, "inertial/pose", (6,), np.zeros(6))
        turn = turned(pose[3:])
        data: dict[str, Any] = {
            "name": model.get("name") or "imported", "frame": "FRD", "gravity": gravity, "water_density": density,
            "mass": mass, "center_of_gravity": (FLU[:3] * pose[:3] + 0.0).tolist(),
            "inertia": _flipped(turn @ inertia(link, reader) @ turn.T, FLU[:3]).tolist(),
            "added_mass": _flipped(self._added(link, plugin, reader), FLU).tolist(),
        }  # fmt: skip
        for key in ("length", "reference_voltage"):
            if model.find(OWN + key) is not None:
                data[key] = reader.number(model, OWN + key)
        data |= self._displaced(link, reader, density * gravity, mass * gravity)
        data |= self._damping(plugin, reader)
        thrusters = [t for p in model.iter("plugin") if (t := self._thruster(p, model, reader)) is not None]
        fins = [f for p in model.iter("plugin") if (f := self._fin(p, model, reader)) is not None]
        data |= ({"thrusters": thrusters} if thrusters else {}) | ({"fins": fins} if fins else {})
        current = reader.numbers(plugin, "default_current", (3,), np.zeros(3))
        if current.any():
            names = {"v_north": current[1], "v_east": current[0], "v_down": -current[2]}
            data["effects"] = {"ocean_current": {k: float(v) for k, v in names.items()}}
        data["source"] = "gz-sim SDF file"
        return data

    def _water(self, root: xml.Element, model: xml.Element, reader: Reader) -> tuple[float, float]:
        """Return density and gravity: ours, of the Buoyancy system, or as gz-sim assumes them."""
        density = 1000.0
        if model.find(OWN + "water_density") is not None:
            density = reader.number(model, OWN + "water_density")
        else:
            found = next(root.iter("uniform_fluid_density"), None)
            if found is not None:
                density = float(reader.parsed(found.text or "", "uniform_fluid_density", (1,))[0])
        gravity = 9.81
        if model.find(OWN + "gravity") is not None:
            gravity = reader.number(model, OWN + "gravity")
        elif root.find("world/gravity") is not None:
            gravity = float(np.linalg.norm(reader.numbers(root, "world/gravity", (3,))))
        return density, gravity

    def _added(self, link: xml.Element, plugin: xml.Element, reader: Reader) -> np.ndarray:
        """Return the added mass, from the link or else from the plugin, where it stands with the other sign."""
        matrix = np.zeros((6, 6))
        element = link.find("inertial/fluid_added_mass")
        if element is not None:
            for i in range(6):
                for j in range(i, 6):
                    matrix[i, j] = matrix[j, i] = reader.number(element, SECOND[i] + SECOND[j], 0.0)
            return matrix
        for i, j in product(range(6), range(6)):
            matrix[i, j] = -reader.number(plugin, f"{AXES[i]}Dot{VELOCITIES[j]}", 0.0)
        return matrix

    def _displaced(
        self, link: xml.Element, reader: Reader, per_volume: float, weight: float
    ) -> dict[str, Any]:
        """Return buoyancy and its centre, from the volume of the link's collision shapes."""
        total, moment = 0.0, np.zeros(3)
        for shape in link.findall("collision"):
            pose = reader.numbers(shape, "pose", (6,), np.zeros(6))
            volume = self._volume(shape, reader)
            total, moment = total + volume, moment + volume * pose[:3]
        if not total > 0:
            reader.unread.append(
                "no collision shape whose volume is known: the vehicle is taken as neutrally buoyant"
            )
            return {"buoyancy": weight, "center_of_buoyancy": [0.0, 0.0, 0.0]}
        return {
            "buoyancy": total * per_volume, "center_of_buoyancy": (FLU[:3] * moment / total + 0.0).tolist()
        }  # fmt: skip

    def _volume(self, shape: xml.Element, reader: Reader) -> float:
        box, ball, tube = (shape.find(f"geometry/{n}") for n in ("box", "sphere", "cylinder"))
        if box is not None:
            return float(np.prod(reader.numbers(box, "size", (3,))))
        if ball is not None:
            return 4 / 3 * np.pi * reader.number(ball, "radius") ** 3
        if tube is not None:
            return np.pi * reader.number(tube, "radius") ** 2 * reader.number(tube, "length")
        geometry = shape.find("geometry")
        kinds = ", ".join(k.tag for k in geometry) if geometry is not None else ""
        reader.unread.append(
            f"collision {shape.get('name')}: the volume of a {kinds or 'shape'} is not worked out"
        )
        return 0.0

    def _damping(self, plugin: xml.Element, reader: Reader) -> dict[str, Any]:
        linear, quadratic, used = np.zeros((6, 6)), np.zeros((6, 6)), False
        products: list[str] = []
        for element in plugin:
            tag = element.tag if isinstance(element.tag, str) else ""
            if tag in SETTINGS or tag.startswith(OWN) or re.fullmatch("[xyzkmn]Dot[UVWPQR]", tag):
                continue
            match = re.fullmatch("([xyzkmn])([UVWPQR])(abs)?([UVWPQR])?", tag)
            value = 0.0 if match is None else reader.number(plugin, tag)
            if match is None:
                reader.unread.append(f"<{tag}> of the hydrodynamics has no place in a model file")
                continue
            i, j = AXES.index(match[1]), VELOCITIES.index(match[2])
            if match[4] is None:
                linear[i, j] = -value
            elif match[3] and match[4] == match[2]:
                quadratic[i, j] = -value
            elif value:
                products.append(tag)
            used = True
        if products:
            some = ", ".join(f"<{tag}>" for tag in products[:3]) + (", ..." if len(products) > 3 else "")
            reader.unread.append(
                f"{len(products)} terms of drag from products of two velocities ({some}) have no place in a model file"
            )
        if not used:
            reader.unread.append("no drag is stated")
        made = {"linear_damping": linear, "quadratic_damping": quadratic}
        return {k: _flipped(m, FLU).tolist() for k, m in made.items() if m.any()}

    def _joint(self, model: xml.Element, name: str, reader: Reader) -> tuple[np.ndarray, np.ndarray] | None:
        """Return place and axis of a joint in the vehicle's frame, x forward, y to port, z up."""
        joint = next((j for j in model.iter("joint") if j.get("name") == name), None)
        child = None if joint is None else (joint.findtext("child") or "").strip()
        link = next((k for k in model.iter("link") if k.get("name") == child), None)
        if joint is None or link is None:
            reader.unread.append(f"joint {name}: it, or the link that it moves, is not in the file")
            return None
        poses = [p for p in (link.find("pose"), joint.find("pose")) if p is not None]
        if any(p.get("relative_to") for p in poses):
            reader.unread.append(f"joint {name}: a pose relative to something else is not followed")
            return None
        pose = reader.numbers(link, "pose", (6,), np.zeros(6))
        own = reader.numbers(joint, "pose", (6,), np.zeros(6))
        turn = turned(pose[3:])
        axis = turn @ turned(own[3:]) @ reader.numbers(joint, "axis/xyz", (3,), [0.0, 0.0, 1.0])
        return pose[:3] + turn @ own[:3], axis

    def _thruster(self, plugin: xml.Element, model: xml.Element, reader: Reader) -> dict[str, Any] | None:
        if not (plugin.get("name") or "").endswith("::Thruster"):
            return None
        name = (plugin.findtext("joint_name") or "").strip()
        found = self._joint(model, name, reader)
        if found is None:
            return None
        limits = [plugin.find(n) is not None for n in ("max_thrust_cmd", "min_thrust_cmd")]
        if not all(limits):
            reader.unread.append(
                f"{name}: left out, without max_thrust_cmd and min_thrust_cmd its thrust is not known"
            )
            return None
        most, least = (reader.number(plugin, n) for n in ("max_thrust_cmd", "min_thrust_cmd"))
        unit: dict[str, Any] = {
            "position": (FLU[:3] * found[0] + 0.0).tolist(), "direction": (FLU[:3] * found[1] + 0.0).tolist(),
            "max_forward": most, "max_reverse": -least,
        }  # fmt: skip
        if plugin.find(OWN + "command") is not None:
            texts = [plugin.findtext(OWN + n) or "" for n in ("command", "thrust")]
            counts = tuple(range(2, 10_001))
            unit["curve"] = {
                k: reader.parsed(t, k, counts).tolist()
                for k, t in zip(("command", "thrust"), texts, strict=True)
            }
        if plugin.find(OWN + "handedness") is not None:
            unit["handedness"] = int(reader.number(plugin, OWN + "handedness"))
        for tag in ("wake_fraction", "alpha_1", "alpha_2", "deadband"):
            if plugin.find(tag) is not None:
                reader.unread.append(f"{name}: <{tag}>")
        return unit

    def _fin(self, plugin: xml.Element, model: xml.Element, reader: Reader) -> dict[str, Any] | None:
        if not (plugin.get("name") or "").endswith("::LiftDrag"):
            return None
        name = (plugin.findtext("link_name") or "").strip()
        joint = next((j for j in model.iter("joint") if (j.findtext("child") or "").strip() == name), None)
        found = None if joint is None else self._joint(model, joint.get("name") or "", reader)
        if found is None:
            reader.unread.append(f"lift of {name}: it does not turn by a joint, so it is no fin")
            return None
        if reader.number(plugin, "cda", 0.0):
            reader.unread.append(f"{name}: <cda>, drag of the fin")
        return {
            "position": (FLU[:3] * (found[0] + reader.numbers(plugin, "cp", (3,), np.zeros(3))) + 0.0).tolist(),
            "axis": (FLU[:3] * found[1] + 0.0).tolist(), "area": reader.number(plugin, "area"),
            "lift_slope": reader.number(plugin, "cla"), "stall": reader.number(plugin, "alpha_stall", 0.26),
        }  # fmt: skip


def inertia(link: xml.Element, reader: Reader) -> np.ndarray:
    """Return the tensor of <inertial><inertia>, (3, 3)."""
    matrix = np.zeros((3, 3))
    element = link.find("inertial/inertia")
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        name = f"i{'xyz'[i]}{'xyz'[j]}"
        if element is not None and element.get(name) is not None:
            value = float(reader.attribute(element, name, 1, [0.0])[0])
        else:
            value = reader.number(element, name, None if i == j else 0.0)
        matrix[i, j] = matrix[j, i] = value
    return matrix


def _flipped(matrix: np.ndarray, signs: np.ndarray) -> np.ndarray:
    return signs[:, None] * matrix * signs + 0.0
