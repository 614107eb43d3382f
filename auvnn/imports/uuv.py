"""UUV Simulator: a URDF (expanded from xacro) or SDF vehicle with the underwater object plugin."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from auvnn.errors import InputError
from auvnn.imports.gz import inertia
from auvnn.imports.tree import Reader, turned

FLU = np.array([1.0, -1.0, -1.0])
POINTS = np.linspace(-1.0, 1.0, 41)
HYDRODYNAMICS = {
    "type", "added_mass", "linear_damping", "quadratic_damping", "linear_damping_forward_speed",
}  # fmt: skip


class UuvSource:
    """Reads UUV Simulator's vehicles; geometry with z up, coefficients as the SNAME derivatives with z down."""

    def knows(self, root: xml.Element) -> bool:
        """Return whether the file has the underwater object plugin."""
        return self._plugin(root) is not None

    def _plugin(self, root: xml.Element) -> xml.Element | None:
        return next(
            (p for p in root.iter("plugin") if "underwater_object" in (p.get("filename") or "")), None
        )

    def read(self, root: xml.Element, reader: Reader) -> dict[str, Any]:
        """Return the mapping of a model file."""
        plugin = self._plugin(root)
        assert plugin is not None
        stated = [k for k in plugin.findall("link") if k.find("hydrodynamic_model") is not None]
        if not stated:
            raise InputError(
                f"{reader.where}: the underwater object has no <link> with a <hydrodynamic_model>"
            )
        wet = stated[0]
        reader.unread += [f"link {k.get('name')}: a second body in the water" for k in stated[1:]]
        name = wet.get("name") or ""
        link = next(
            (k for k in root.iter("link") if k.get("name") == name and k.find("inertial") is not None), None
        )
        if link is None:
            raise InputError(f"{reader.where}: there is no link '{name}' with an <inertial>")
        density, gravity = reader.number(plugin, "fluid_density", 1028.0), 9.81
        mass = self._mass(link, reader)
        place, angles = self._origin(link.find("inertial"), reader)
        turn = turned(angles)
        tensor = turn @ inertia(link, reader) @ turn.T
        data: dict[str, Any] = {
            "name": root.get("name") or "imported", "frame": "FRD", "gravity": gravity, "water_density": density,
            "mass": mass, "center_of_gravity": (FLU * place + 0.0).tolist(),
            "inertia": (FLU[:, None] * tensor * FLU + 0.0).tolist(),
            "center_of_buoyancy": (FLU * reader.numbers(wet, "center_of_buoyancy", (3,), np.zeros(3)) + 0.0).tolist(),
            "buoyancy": mass * gravity, "source": "UUV Simulator vehicle file",
        }  # fmt: skip
        if not reader.number(wet, "neutrally_buoyant", 0.0):
            data["buoyancy"] = reader.number(wet, "volume") * density * gravity
        data |= self._hydrodynamics(wet, reader)
        thrusters = []
        for one in root.iter("plugin"):
            file = one.get("filename") or ""
            if "thruster" in file and one.find("conversion") is not None:
                made = self._thruster(one, root, reader)
                thrusters += [made] if made is not None else []
            elif "fin_" in file:
                reader.unread.append(
                    f"fin {(one.findtext('joint_name') or one.get('name') or '').strip()}: its lift"
                )
        if thrusters:
            data["thrusters"] = thrusters
            lags = [self._lag(p, reader) for p in root.iter("plugin") if p.find("dynamics") is not None]
            if lags and all(lag == lags[0] and lag > 0 for lag in lags):
                data["effects"] = {"propeller_lag": {"time_constant": lags[0]}}
            elif any(lags):
                reader.unread.append("rotor dynamics: time constants that differ between thrusters")
        return data

    def _mass(self, link: xml.Element, reader: Reader) -> float:
        element = link.find("inertial/mass")
        if element is not None and element.get("value") is not None:
            return float(reader.attribute(element, "value", 1, [0.0])[0])
        return reader.number(link, "inertial/mass")

    def _origin(self, element: xml.Element | None, reader: Reader) -> tuple[np.ndarray, np.ndarray]:
        """Return place and angles of an element, as URDF (<origin>) or SDF (<pose>) state them."""
        origin = None if element is None else element.find("origin")
        if origin is not None:
            return tuple(reader.attribute(origin, n, 3, np.zeros(3)) for n in ("xyz", "rpy"))  # type: ignore[return-value]
        pose = reader.numbers(element, "pose", (6,), np.zeros(6))
        return pose[:3], pose[3:]

    def _hydrodynamics(self, wet: xml.Element, reader: Reader) -> dict[str, Any]:
        stated = wet.find("hydrodynamic_model")
        assert stated is not None
        kind = (stated.findtext("type") or "fossen").strip()
        if kind != "fossen":
            raise InputError(
                f"{reader.where}: a hydrodynamic_model of type {kind} states no coefficients; only fossen is read"
            )
        added = reader.numbers(stated, "added_mass", (6, 36))
        found: dict[str, Any] = {"added_mass": _square(added).tolist()}
        linear = reader.numbers(stated, "linear_damping", (6, 36), np.zeros(6))
        quadratic = _square(reader.numbers(stated, "quadratic_damping", (6, 36), np.zeros(6)))
        if (quadratic - np.diag(np.diag(quadratic))).any():
            reader.unread.append("quadratic_damping beyond the diagonal, which UUV Simulator leaves out too")
        made = {
            "linear_damping": -_square(linear) + 0.0,
            "quadratic_damping": -np.diag(np.diag(quadratic)) + 0.0,
        }
        found |= {k: m.tolist() for k, m in made.items() if m.any()}
        if reader.numbers(stated, "linear_damping_forward_speed", (6, 36), np.zeros(6)).any():
            reader.unread.append("linear_damping_forward_speed: damping in proportion to the forward speed")
        reader.unread += [
            f"<{e.tag}> of the hydrodynamic_model" for e in stated if e.tag not in HYDRODYNAMICS
        ]
        return found

    def _lag(self, plugin: xml.Element, reader: Reader) -> float:
        kind = (plugin.findtext("dynamics/type") or "").strip()
        if kind == "FirstOrder":
            return reader.number(plugin, "dynamics/timeConstant", 0.0)
        if kind not in ("", "ZeroOrder"):
            reader.unread.append(f"rotor dynamics of type {kind}")
        return 0.0

    def _thruster(self, plugin: xml.Element, root: xml.Element, reader: Reader) -> dict[str, Any] | None:
        name = (plugin.findtext("jointName") or plugin.get("name") or "").strip()
        joint = next((j for j in root.iter("joint") if j.get("name") == name), None)
        if joint is None:
            reader.unread.append(f"thruster {name}: there is no such joint; left out")
            return None
        place, angles = self._origin(joint, reader)
        axis = joint.find("axis")
        along = np.array([1.0, 0.0, 0.0])
        if axis is not None:
            stated = axis.get("xyz") is not None
            along = (
                reader.attribute(axis, "xyz", 3, along)
                if stated
                else reader.numbers(axis, "xyz", (3,), along)
            )
        curve = self._curve(plugin, name, reader)
        if curve is None:
            return None
        return {
            "position": (FLU * place + 0.0).tolist(), "direction": (FLU * (turned(angles) @ along) + 0.0).tolist(),
            **curve,
        }  # fmt: skip

    def _curve(self, plugin: xml.Element, name: str, reader: Reader) -> dict[str, Any] | None:
        """Return the thrust curve over commands in [-1, 1], full command being the largest input."""
        kind = (plugin.findtext("conversion/type") or "").strip()
        gain = reader.number(plugin, "gain", 1.0)
        high = reader.number(plugin, "clampMax", 0.0)
        low = reader.number(plugin, "clampMin", -high)
        if kind == "LinearInterp":
            counts = tuple(range(2, 10_001))
            x = reader.numbers(plugin, "conversion/inputValues", counts)
            y = reader.numbers(plugin, "conversion/outputValues", (len(x),))
            return {"curve": {"command": (x / np.abs(x).max()).tolist(), "thrust": y.tolist()}}
        if kind == "Basic":
            k = reader.number(plugin, "conversion/rotorConstant")
            most, least = k * (gain * high) ** 2, k * (gain * low) ** 2
            if plugin.find("thrustMax") is not None and not high:
                most = reader.number(plugin, "thrustMax")
                least = -reader.number(plugin, "thrustMin", -most)
            if not most > 0:
                reader.unread.append(
                    f"thruster {name}: without clampMax or thrustMax its thrust is not known"
                )
                return None
            return {"max_forward": most, "max_reverse": least, "curve": "quadratic"}
        if kind == "Bessa" and high > 0:
            left, right = (reader.number(plugin, f"conversion/rotorConstant{s}") for s in "LR")
            below, above = (reader.number(plugin, f"conversion/delta{s}") for s in "LR")
            x = gain * high * POINTS
            square = x * np.abs(x)
            y = np.where(square >= above, right * (square - above), 0.0)
            y = np.where(square <= below, left * (square - below), y)
            reader.unread.append(f"thruster {name}: its dead zone is read as a table of {len(POINTS)} points")
            return {"curve": {"command": POINTS.tolist(), "thrust": y.tolist()}}
        reader.unread.append(
            f"thruster {name}: conversion of type {kind or 'unknown'} without limits; left out"
        )
        return None


def _square(numbers: np.ndarray) -> np.ndarray:
    return np.diag(numbers) if len(numbers) == 6 else numbers.reshape(6, 6)
