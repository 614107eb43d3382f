"""From the mapping of a model file to a vehicle: fields, frame, checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from auvnn.errors import ModelError
from auvnn.vehicle import checks
from auvnn.vehicle.doubts import doubts
from auvnn.vehicle.fields import Fields, number, shown
from auvnn.vehicle.parts import DEFAULT_UNCERTAINTY, Array, DampingElement
from auvnn.vehicle.reading_parts import read_element, read_fin, read_thruster, turned
from auvnn.vehicle.reduced import Ballast, MovingMass, Reduced, check_drives

if TYPE_CHECKING:
    from auvnn.vehicle.vehicle import Vehicle

Part = TypeVar("Part")

KEYS = (
    "name",
    "frame",
    "gravity",
    "water_density",
    "mass",
    "buoyancy",
    "length",
    "center_of_gravity",
    "center_of_buoyancy",
    "inertia",
    "added_mass",
    "linear_damping",
    "quadratic_damping",
    "damping_elements",
    "thrusters",
    "fins",
    "reference_voltage",
    "reduced",
    "ballast",
    "moving_mass",
    "uncertainty",
    "effects",
    "source",
)
# Half a turn about x: front-left-up and front-right-down are each other's image.
_FRD: Array = np.eye(3)
_FLU: Array = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])


def vehicle_from_dict(
    kind: type[Vehicle], data: Mapping[str, Any], where: str, also: frozenset[str]
) -> Vehicle:
    """Return the validated vehicle, of class `kind`, of a model file's mapping; see `Vehicle.from_dict`.

    Args:
        kind: class of the vehicle.
        data: of the model file.
        where: it stands, for messages.
        also: further keys that are allowed, such as those of saved models.
    """
    fields = Fields(data, where, "vehicle", KEYS, also)
    warnings: list[str] = []
    turn = _frame(fields)
    turn6 = np.zeros((6, 6))
    turn6[:3, :3] = turn6[3:, 3:] = turn

    gravity = _assumed(fields, "gravity", 9.81, "m/s2", warnings)
    water_density = _assumed(fields, "water_density", 1025.0, "kg/m3", warnings)
    mass = fields.positive("mass")
    buoyancy = _assumed(fields, "buoyancy", mass * gravity, "N (the weight)", warnings)
    cube = (buoyancy / (water_density * gravity)) ** (1 / 3)
    length = _assumed(fields, "length", cube, "m (the cube root of the displaced volume)", warnings)
    inertia = checks.symmetrized(fields.matrix("inertia", 3), where, "inertia")
    checks.check_inertia(inertia, where)
    added_mass = checks.symmetrized(fields.matrix("added_mass", 6), where, "added_mass")

    damping: dict[str, Array | None] = {"linear_damping": None, "quadratic_damping": None}
    for name, check in (
        ("linear_damping", checks.check_linear_damping),
        ("quadratic_damping", checks.check_quadratic_damping),
    ):
        if fields.has(name):
            matrix = fields.matrix(name, 6)
            check(matrix, where)
            # |nu| nu is odd, so a change of frame turns quadratic damping as it does linear.
            damping[name] = turned(turn6, matrix) @ turn6

    elements = _parts(fields, "damping_elements", read_element, turn)
    thrusters = _parts(fields, "thrusters", read_thruster, turn)
    fins = _parts(fields, "fins", read_fin, turn)
    groups = _groups(damping, elements)
    center_of_gravity = turned(turn, fields.array("center_of_gravity", (3,)))
    inertia, added_mass = turned(turn, inertia) @ turn, turned(turn6, added_mass) @ turn6
    body = checks.rigid_body(mass, inertia, center_of_gravity)
    # Here, where the file is known; the vehicle checks itself again and knows only its name.
    doubt = checks.check_added_mass(added_mass, body, where)
    vehicle = kind(
        name=_name(fields),
        gravity=gravity,
        water_density=water_density,
        mass=mass,
        buoyancy=buoyancy,
        length=length,
        center_of_gravity=center_of_gravity,
        center_of_buoyancy=turned(turn, fields.array("center_of_buoyancy", (3,))),
        inertia=inertia,
        added_mass=added_mass,
        linear_damping=damping["linear_damping"],
        quadratic_damping=damping["quadratic_damping"],
        damping_elements=elements,
        thrusters=thrusters,
        fins=fins,
        reference_voltage=fields.positive("reference_voltage") if fields.has("reference_voltage") else None,
        uncertainty=_uncertainty(fields, groups, warnings),
        effects=_effects(fields),
        source=fields.text("source", ""),
        reduced=Reduced.read(fields.data["reduced"], f"{fields.where}: reduced")
        if fields.has("reduced")
        else Reduced(),
        ballast=Ballast.read(fields.data["ballast"], f"{fields.where}: ballast")
        if fields.has("ballast")
        else None,
        moving_mass=MovingMass.read(fields.data["moving_mass"], f"{fields.where}: moving_mass")
        if fields.has("moving_mass")
        else None,
    )
    check_drives(vehicle, where)
    if doubt:
        warnings.append(doubt)
    if turn is not _FRD and vehicle.effects:
        warnings.append("frame FLU turns the vehicle's own numbers; those of effects are read as FRD and NED")
    warnings.extend(doubts(vehicle))
    # The vehicle is frozen, but nobody else has seen it yet.
    object.__setattr__(vehicle, "warnings", tuple(warnings))
    return vehicle


def check_words(fields: Fields) -> None:
    """Refuse a name, uncertainties, effects or a source that a model file could not hold.

    Raises:
        ModelError: with the first of them.
    """
    _name(fields)
    _uncertainty(fields, set(), [])
    _effects(fields)
    fields.text("source", "")
    if fields.has("reference_voltage"):
        fields.positive("reference_voltage")


def _frame(fields: Fields) -> Array:
    frame = fields.text("frame", "FRD")
    if frame not in ("FRD", "FLU"):
        raise fields.refuse("frame", "not a body frame", "use FRD (z down) or FLU (z up)")
    return _FRD if frame == "FRD" else _FLU


def _name(fields: Fields) -> str:
    name = fields.text("name")
    if not name.strip() or len(name) > 200 or not name.isprintable():
        raise fields.refuse("name", "not a name", "use one line of at most 200 printable characters")
    return name


def _assumed(fields: Fields, key: str, value: float, unit: str, warnings: list[str]) -> float:
    if not fields.has(key):
        warnings.append(f"no {key} stated: {value:.6g} {unit} assumed")
    return fields.positive(key, value)


def _parts(
    fields: Fields, key: str, read: Callable[[Any, str, Array], Part], turn: Array
) -> tuple[Part, ...]:
    items = enumerate(fields.items(key))
    return tuple(read(item, f"{fields.where}: {key}[{i}]", turn) for i, item in items)


def _groups(damping: dict[str, Array | None], elements: tuple[DampingElement, ...]) -> set[str]:
    present = {"added_mass", "inertia"}
    for group, name in (("linear_damping", "linear"), ("quadratic_damping", "quadratic")):
        if damping[group] is not None or any(getattr(element, name).any() for element in elements):
            present.add(group)
    return present


def _uncertainty(fields: Fields, groups: set[str], warnings: list[str]) -> dict[str, float]:
    stated = fields.data.get("uncertainty")
    where = f"{fields.where}: uncertainty"
    inner = Fields({} if stated is None else stated, where, "uncertainty", tuple(DEFAULT_UNCERTAINTY))
    result = {}
    for group, default in DEFAULT_UNCERTAINTY.items():
        value = inner.number(group, default)
        if value < 0 or value > 10:
            raise inner.refuse(group, "not a relative deviation", "use a fraction, like 0.1 for 10 %")
        if not inner.has(group) and group in groups:
            warnings.append(f"no uncertainty stated for {group}: {default:g} assumed")
        result[group] = value
    return result


def _effects(fields: Fields) -> dict[str, dict[str, Any]]:
    stated = fields.data.get("effects")
    where = f"{fields.where}: effects"
    if stated is None:
        return {}
    if not isinstance(stated, Mapping):
        raise ModelError(f"{where}: is {shown(stated)}; write `effect: {{parameter: value}}` pairs")
    result = {}
    for name, parameters in stated.items():
        if not isinstance(name, str):
            raise ModelError(f"{where}: {shown(name)} is not the name of an effect; use a word")
        if parameters is not None and not isinstance(parameters, Mapping):
            raise ModelError(f"{where}: {name} is {shown(parameters)}; write `{name}: {{parameter: value}}`")
        result[name] = {}
        for key, value in (parameters or {}).items():
            if not isinstance(key, str):
                raise ModelError(f"{where}: {name}: {shown(key)} is not the name of a parameter; use a word")
            if key == "uncertainty" and value is not None:
                result[name][key] = _deviations(value, f"{where}: {name}")
                continue
            result[name][key] = _plain(value, where, f"{name}.{key}")
    return result


def _deviations(value: Any, where: str) -> dict[str, float]:
    """Return standard deviations by parameter."""
    if not isinstance(value, Mapping):
        raise ModelError(
            f"{where}: uncertainty is {shown(value)}; write `uncertainty: {{parameter: deviation}}`"
        )
    out = {str(k): number(where, f"uncertainty.{k}", v) for k, v in value.items()}
    for key, deviation in out.items():
        if deviation < 0:
            raise ModelError(
                f"{where}: uncertainty.{key} is {deviation:g}: a deviation is not negative; drop the sign"
            )
    return out


def _plain(value: Any, where: str, field: str, depth: int = 0) -> Any:
    # Which parameters an effect has is its own affair; that they are finite data is ours.
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if depth < 4 and isinstance(value, (list, tuple)):
        return [_plain(item, where, f"{field}[{i}]", depth + 1) for i, item in enumerate(value)]
    return number(where, field, value)
