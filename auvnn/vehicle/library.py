"""Finding vehicles: the built-in ones by name, others by file or by the folder of a saved model."""

from __future__ import annotations

from pathlib import Path

from auvnn.catalogue import unknown_name
from auvnn.config import config_dir, read_yaml
from auvnn.errors import ModelError
from auvnn.vehicle.vehicle import Vehicle

MODEL_FILE = "model.yaml"
# What a saved model keeps in the same file beside the vehicle; the model reads it, not the vehicle.
MODEL_KEYS = ("actuation", "damping_subnetworks")


def builtin_vehicles() -> list[str]:
    """Return the names of the vehicles that come with the package."""
    return sorted(path.stem for path in (config_dir() / "vehicle").glob("*.yaml"))


def vehicle_path(name_or_path: str | Path) -> Path:
    """Return the YAML file of a built-in vehicle, of a path, or in the folder of a saved model.

    A built-in name wins over a file of the same name; `./name` means the file.

    Raises:
        ModelError: there is no such vehicle; the message offers the nearest name.
    """
    text = str(name_or_path)
    if not text.isprintable():
        raise ModelError(f"{text[:200]!r} is no vehicle and no path; name a vehicle or a file")
    names = builtin_vehicles()
    if text in names:
        return config_dir() / "vehicle" / f"{text}.yaml"
    path = Path(name_or_path)
    try:
        folder, file = bool(text) and path.is_dir(), path.is_file()
    except OSError as error:
        words = f"'{text[:200]}' cannot be a path ({error.strerror})"
        raise ModelError(f"{words}; name a file, or one of: {', '.join(names)}") from None
    if file:
        return path
    if folder:
        if (path / MODEL_FILE).is_file():
            return path / MODEL_FILE
        raise ModelError(f"{path}: holds no {MODEL_FILE}, so it is no saved model; name another folder")
    if path.suffix.lower() in (".yaml", ".yml") or len(path.parts) > 1:
        raise ModelError(
            f"{path}: there is no such file or folder; check the path, or use one of: {', '.join(names)}"
        )
    raise ModelError(unknown_name("vehicle", text, names) + "; or give the path of a YAML file")


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """Return a vehicle by built-in name, YAML path, or folder of a saved model.

    Raises:
        ModelError: there is no such vehicle, or it is not physical.
        InputError: the file cannot be read.
        ConfigError: the file says something that a data file must not say.
    """
    path = vehicle_path(name_or_path)
    also = MODEL_KEYS if path.name == MODEL_FILE else ()
    return Vehicle.from_dict(read_yaml(path), str(path), also=also)
