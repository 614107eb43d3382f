"""Reads a Slocum glider's file in a process of its own; see `isolated`. Imports nothing of auvnn."""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path
from typing import Any


def main(folder: str, memory: str, path: str, lists: str) -> None:
    """Write times and values of each sensor into the folder.

    Args:
        folder: where the arrays go.
        memory: most bytes of address space.
        path: of the file.
        lists: folder with the lists of sensors.
    """
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    import numpy as np

    out = Path(folder)
    entries: list[list[object]] = []
    offset = 0
    try:
        import dbdreader  # pyright: ignore[reportMissingImports]

        log = dbdreader.DBD(path, cacheDir=lists)
        with (out / "arrays.bin").open("wb") as stream:
            names = list(log.parameterNames)
            # Each call goes through the whole file: one for all of some hundred sensors takes a moment, one each minutes.
            for name, (t, v) in zip(names, _all(log, names), strict=True):
                for mark, values in (("t", t), ("v", v)):
                    data = np.ascontiguousarray(values, dtype="<f8")
                    entries.append([f"{name}|{mark}", "<f8", list(data.shape), offset])
                    stream.write(data.tobytes())
                    offset += data.nbytes
    except BaseException as problem:
        words = (
            f"cannot be read by dbdreader ({type(problem).__name__}: {' '.join(str(problem).split())[:150]})"
        )
        (out / "index.json").write_text(json.dumps({"error": words}))
        return
    (out / "index.json").write_text(json.dumps({"arrays": entries}))


def _all(log: Any, names: list[str]) -> list[tuple[Any, Any]]:
    """Return times and values of each sensor; nothing of one that the file announces and does not hold."""
    if len(names) == 1:
        return [log.get(names[0], check_for_invalid_parameters=False)]
    return log.get(*names, check_for_invalid_parameters=False) if names else []


if __name__ == "__main__":
    main(*sys.argv[1:5])
