"""Models read from disk: a built-in name, a vehicle's YAML file, or a folder that `saving` wrote."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from auvnn.config import parse_yaml
from auvnn.damping.bank import DampingBank
from auvnn.damping.region import Region
from auvnn.effects import Effect, effect_class
from auvnn.effects.registering import names_of
from auvnn.errors import ConfigError, ModelError
from auvnn.models.actuation.command_path import CommandPath
from auvnn.models.grey_box import GreyBox
from auvnn.models.joint_covariance import JointCovariance
from auvnn.models.saving import (
    COMMANDS,
    COVARIANCE,
    MODEL,
    PASSIVE,
    REGION,
    STRUCTURE,
    SUBNETWORKS,
    UNCERTAINTY,
    WEIGHTS,
    reads_again,
)
from auvnn.models.structures import build_structure
from auvnn.models.structures.base import Structure
from auvnn.storage import folder_exists, read_folder, tensors_from_bytes
from auvnn.vehicle import Vehicle, load_vehicle


def from_vehicle(vehicle: Vehicle, actuation: str | None = None) -> GreyBox:
    """Return the model of a vehicle with the effects that its file states."""
    how = actuation or ("thrusters" if vehicle.thrusters else "wrench")
    effects = [_stated(vehicle, how, name, values) for name, values in vehicle.effects.items()]
    return GreyBox(vehicle, effects, actuation=how)


def _stated(vehicle: Vehicle, actuation: str, name: str, values: Mapping[str, Any]) -> Effect:
    """Return an effect as a model file states it, with the standard deviations beside its values."""
    given = {k: v for k, v in values.items() if k != UNCERTAINTY}
    effect = effect_class(name).build(vehicle, actuation, given)
    effect.state_uncertainty(values.get(UNCERTAINTY) or {})
    return effect


def load(source: str | Path, actuation: str | None = None) -> GreyBox:
    """Return the model of a built-in vehicle, a YAML file, or a saved folder.

    Args:
        source: a name, or a path.
        actuation: "thrusters" or "wrench"; by default what the model was saved with, else thrusters where
            the vehicle has them.

    Raises:
        ModelError: the file is damaged, incomplete, not physical, or from a newer auvnn.
        ConfigError: an unknown name.

    Example:
        ```python
        model = auvnn.load("bluerov2_heavy")  # or "my_vehicle.yaml", or a folder that was saved
        by_wrench = auvnn.load("rov95", actuation="wrench")
        ```
    """
    path = Path(source)
    if not folder_exists(path):
        return from_vehicle(load_vehicle(str(source)), actuation)
    files = read_folder(path)
    if MODEL not in files:
        raise ModelError(
            f"{path} holds no {MODEL}: give a saved model's folder, a YAML file or a built-in name"
        )
    return from_contents(files, path, actuation)


def from_contents(files: Mapping[str, bytes], path: Path, actuation: str | None = None) -> GreyBox:
    """Return the model that the files of a folder describe; see `contents`.

    Args:
        files: their contents by name.
        path: of the folder, for messages.
        actuation: "thrusters" or "wrench"; as it was saved where None.
    """
    # Parsed from the bytes whose hash was checked, not from the file, which may have changed since.
    try:
        text = files[MODEL].decode("utf-8")
    except UnicodeDecodeError as error:
        raise ModelError(
            f"{path / MODEL}: is not UTF-8 text (byte {error.start}): save the model again"
        ) from None
    data: dict[str, Any] = parse_yaml(text, str(path / MODEL))
    joint, commands = data.pop(COVARIANCE, None), data.pop(COMMANDS, None)
    model = _made(data, files, path, actuation)
    if joint is not None:
        known = [f"{e.name}.{p}" for e in model.members for p in e.values()]
        model.joint = JointCovariance.read(joint, known, str(path / MODEL))
    if commands is not None:
        model.commands = CommandPath.read(commands, str(path / MODEL))
    return model


def _made(data: dict[str, Any], files: Mapping[str, bytes], path: Path, actuation: str | None) -> GreyBox:
    """Return the model that the entries of a model file describe, with the weights beside it."""
    networks = data.pop(SUBNETWORKS, None)
    region = data.pop(REGION, None)
    passive = data.pop(PASSIVE, False)
    structure = data.pop(STRUCTURE, None)
    saved_actuation = data.pop("actuation", None)
    vehicle = Vehicle.from_dict(data, where=str(path / MODEL))
    model = from_vehicle(vehicle, actuation or saved_actuation)
    if structure is not None:
        return _structured(model, structure, files, path)
    if networks is None:
        return model
    if WEIGHTS not in files:
        raise ModelError(f"{path} describes damping subnetworks but holds no {WEIGHTS}: save the model again")
    bank = DampingBank.from_description(networks)
    expected = {k: (tuple(v.shape), v.dtype) for k, v in bank.state_dict().items()}
    bank.load_state_dict(tensors_from_bytes(files[WEIGHTS], expected))
    for name in ("input_scale", "output_scale"):
        if not bool((getattr(bank, name) > 0.0).all()):
            raise ModelError(
                f"{path / WEIGHTS}: {name} must be positive in each direction: train the model again"
            )
    if not isinstance(passive, bool):
        raise ModelError(f"{path / MODEL}: {PASSIVE} is {passive!r}: save the model again")
    bank.passive = passive
    bank.region = None if region is None else Region.read(region, str(path / MODEL))
    return GreyBox(model.vehicle, model.copied_effects(), bank, model.actuation)


def _structured(model: GreyBox, described: Any, files: Mapping[str, bytes], path: Path) -> GreyBox:
    """Return the model in one of the structures other than the six damping subnetworks."""
    if not isinstance(described, dict) or not isinstance(described.get("name"), str) or WEIGHTS not in files:
        raise ModelError(
            f"{path}: its '{STRUCTURE}' has no name, or there is no {WEIGHTS}: save the model again"
        )
    options = {str(k): v for k, v in described.items() if k != "name"}
    try:
        made = build_structure(
            described["name"],
            model.vehicle,
            effects=model.copied_effects(),
            actuation=model.actuation,
            **options,
        )
    except (ConfigError, TypeError) as problem:
        raise ModelError(f"{path}: its '{STRUCTURE}' cannot be built: {problem}") from None
    if not isinstance(made, Structure):
        raise ModelError(f"{path}: '{described['name']}' with these options has no weights of its own")
    expected = {k: (tuple(v.shape), v.dtype) for k, v in made.learned.state_dict().items()}
    made.learned.load_state_dict(tensors_from_bytes(files[WEIGHTS], expected))
    return made


def remove(model: GreyBox, effects: str | list[str]) -> GreyBox:
    """Return the model without one effect or several; everything else stays as it is.

    Raises:
        ConfigError: the model has no such effect.

    Example:
        ```python
        model = auvnn.load("rov95").with_effects({"ocean_current": {"v_north": 0.2}})
        plain = auvnn.remove(model, "ocean_current")
        ```
    """
    effects = names_of(effects)
    names = [effects] if isinstance(effects, str) else list(effects)
    for name in names:
        model.effect(name)
    return model.rebuilt(e for e in model.copied_effects() if e.name not in names)


reads_again(from_contents)
