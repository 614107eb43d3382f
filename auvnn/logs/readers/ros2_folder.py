"""A ROS 2 bag is a folder: `metadata.yaml` names the files that the recording was split over."""

from __future__ import annotations

from pathlib import Path

from auvnn.config import read_yaml
from auvnn.errors import AuvnnError, InputError

_SUFFIXES = (".mcap", ".db3")


def ros2_files(folder: Path) -> list[Path]:
    """Return the files of a bag, in the order of the recording.

    Raises:
        InputError: one of them is missing, packed as a whole, or lies outside the folder.
    """
    try:
        told = read_yaml(folder / "metadata.yaml").get("rosbag2_bagfile_information", {})
        names = [str(n) for n in told.get("relative_file_paths", [])] if isinstance(told, dict) else []
    except AuvnnError:
        names = []  # what the folder holds says enough
    if not names:
        names = sorted(p.name for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES)
    files = []
    for name in names:
        # Some releases wrote the path from where the recorder stood.
        path = folder / Path(name).name
        if not path.is_file():
            packed = next((p for p in (path, *folder.glob(f"{path.name}.*")) if p.is_file()), None)
            if packed is not None:
                raise InputError(f"{packed}: is packed as a whole: unpack it first (zstd -d)")
            raise InputError(
                f"{folder}: the bag names the file '{path.name}', which is not there; copy the whole folder"
            )
        if path.suffix == ".zstd":
            raise InputError(f"{path}: is packed as a whole: unpack it first (zstd -d)")
        files.append(path)
    if not files:
        raise InputError(f"{folder}: is a ROS 2 bag without a file of messages")
    return files
