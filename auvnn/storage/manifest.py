"""What stands in a folder's manifest: names that are plain, formats that cannot run code, sizes in reason."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from auvnn.errors import InputError, ModelError

MANIFEST = "manifest.json"
MOST_BYTES = 2 * 1024**3
# Only formats that cannot run code when they are read.
SUFFIXES = (
    ".safetensors",
    ".json",
    ".yaml",
    ".yml",
    ".md",
    ".txt",
    ".csv",
    ".parquet",
    ".html",
    ".png",
    ".svg",
)
CODE_SUFFIXES = (".pt", ".pth", ".pkl", ".pickle", ".ckpt", ".joblib", ".npy", ".npz", ".bin")


def check_name(name: str, path: Path) -> None:
    """Refuse a name that leads elsewhere or promises a format that has no place in a folder.

    Raises:
        InputError: with the folder and the name.
    """
    plain = name not in ("", ".", "..") and not any(c in name for c in "/\\:\0") and not name.startswith(".")
    if not plain:
        raise InputError(f"{path}: '{name}' is not a plain file name")
    if Path(name).suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: '{name}': files in this folder end in {' '.join(SUFFIXES)}")


def read_manifest(path: Path, schema: str) -> dict[str, Any]:
    """Return what a folder must hold: SHA-256 and size by file name.

    Args:
        path: the folder.
        schema: kind and newest version that the caller understands.

    Raises:
        ModelError: there is no manifest, or what it says must not be trusted.
    """
    file = path / MANIFEST
    if not file.is_file():
        raise ModelError(
            f"{path}: there is no {MANIFEST}: this is not a folder that auvnn saved, or not all of it"
        )
    if file.stat().st_size > 1_000_000:
        raise ModelError(f"{file}: larger than a manifest can be: restore the folder from a copy")
    try:
        manifest = json.loads(file.read_bytes())
        found, files = manifest["schema"], dict(manifest["files"])
        kind, version = found.rsplit("/", 1)
        number = int(version)
        entries = {n: {"sha256": str(e["sha256"]), "bytes": int(e["bytes"])} for n, e in files.items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ModelError(f"{file}: damaged, it cannot be read: restore the folder from a copy") from error
    own_kind, own_version = schema.rsplit("/", 1)
    if kind != own_kind:
        raise ModelError(f"{path}: holds '{found}', but '{own_kind}' is wanted here")
    if not 1 <= number <= int(own_version):
        raise ModelError(f"{path}: written as '{found}', this auvnn reads up to '{schema}': upgrade auvnn")
    for name, entry in entries.items():
        if Path(name).suffix.lower() in CODE_SUFFIXES:
            raise ModelError(f"{path}: names '{name}', a format that can run code when it is read: refused")
        try:
            check_name(name, path)
        except InputError as error:
            raise ModelError(str(error)) from error
        if not 0 <= entry["bytes"] <= MOST_BYTES:
            raise ModelError(
                f"{path}: '{name}' claims {entry['bytes']} bytes, more than is sensible: refused"
            )
    return entries
