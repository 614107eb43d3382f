"""Reads a Slocum glider's file in a process of its own; see `isolated`. Imports nothing of auvnn."""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path


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
            for name in log.parameterNames:
                try:
                    t, v = log.get(name)
                except (dbdreader.DbdError, ValueError):
                    continue
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


if __name__ == "__main__":
    main(*sys.argv[1:5])
