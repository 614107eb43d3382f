"""Reads the numbers of an HDF5 file in a process of its own; see `isolated`. Imports nothing of auvnn."""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path

MOST_ARRAYS, MOST_DEPTH = 5_000, 12


def main(folder: str, memory: str, path: str) -> None:
    """Write the arrays of the file into the folder.

    Args:
        folder: where the arrays go.
        memory: most bytes of address space.
        path: of the file.
    """
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    out = Path(folder)
    try:
        import h5py
    except ImportError:
        (out / "index.json").write_text(json.dumps({"missing": ["h5py", "hdf"]}))
        return
    entries: list[list[object]] = []
    state = {"offset": 0, "left": 0}
    limit = max(200_000_000, 40 * Path(path).stat().st_size)
    try:
        with h5py.File(path, "r") as file, (out / "arrays.bin").open("wb") as stream:
            _group(h5py, file, "", 0, entries, state, stream, limit, set())
    except (
        OSError,
        RuntimeError,
        ValueError,
        KeyError,
        TypeError,
        MemoryError,
        OverflowError,
        AttributeError,
    ) as problem:
        words = f"is a damaged HDF5 file ({type(problem).__name__}: {' '.join(str(problem).split())[:150]})"
        (out / "index.json").write_text(json.dumps({"error": words}))
        return
    (out / "index.json").write_text(json.dumps({"arrays": entries}))


def _group(h5py, group, prefix, depth, entries, state, stream, limit, seen):
    if depth > MOST_DEPTH:
        return
    for name in group:
        if len(entries) >= MOST_ARRAYS or name.startswith("#"):
            return
        try:
            link = group.get(name, getlink=True)
            if isinstance(link, (h5py.SoftLink, h5py.ExternalLink)):
                continue  # an external link could name any file of this machine
            item = group[name]
        except (KeyError, OSError, RuntimeError, ValueError):
            continue
        full = f"{prefix}.{name}" if prefix else name
        if isinstance(item, h5py.Group):
            mark = (item.file.id.id, hash(item.id))
            if mark not in seen:
                seen.add(mark)
                _group(h5py, item, full, depth + 1, entries, state, stream, limit, seen)
        elif isinstance(item, h5py.Dataset):
            _dataset(item, full, entries, state, stream, limit)


def _dataset(item, full, entries, state, stream, limit):
    import numpy as np

    if (
        item.dtype.kind not in "iufb"
        or item.dtype.itemsize > 8
        or item.ndim > 3
        or item.is_virtual
        or item.external
    ):
        return
    size = 8 * int(item.size)
    if not 0 < size <= limit or state["offset"] + size > limit:
        return
    if item.attrs.get("MATLAB_empty", 0):
        return
    matlab = "MATLAB_class" in item.attrs
    values = item[()]
    values = np.asarray(values).T if matlab else np.asarray(values)
    whole = values.dtype.kind in "iu" and values.dtype.itemsize == 8
    fill = item.attrs.get("_FillValue", item.attrs.get("missing_value"))
    if fill is not None and np.ndim(fill) <= 1 and np.asarray(fill).dtype.kind in "iuf":
        missing = np.isin(values, np.atleast_1d(fill))
        if missing.any():
            values = np.where(missing, np.nan, values.astype(np.float64))
            whole = False
    scale, offset = (item.attrs.get(k) for k in ("scale_factor", "add_offset"))
    for number, use in ((scale, "scale"), (offset, "offset")):
        if number is not None and np.asarray(number).size == 1 and np.asarray(number).dtype.kind in "iuf":
            value = float(np.asarray(number).reshape(-1)[0])
            values = (
                values.astype(np.float64) * value if use == "scale" else values.astype(np.float64) + value
            )
            whole = False
    kind = "<i8" if whole and values.dtype.kind == "i" else "<f8"
    data = np.ascontiguousarray(values, dtype=kind)
    entries.append([full, kind, list(data.shape), state["offset"]])
    stream.write(data.tobytes())
    state["offset"] += data.nbytes


if __name__ == "__main__":
    main(*sys.argv[1:4])
