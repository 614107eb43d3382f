"""Reading by C code that damaged files can crash: in a process of its own, with little memory and little time."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError, MissingExtra


def run_isolated(
    worker: str, arguments: list[str], where: str, memory: int, seconds: float
) -> dict[str, NDArray[np.float64]]:
    """Return the arrays that a worker reads, by name.

    The worker is a file beside this one that imports nothing of auvnn. It writes `arrays.bin` and, last of all,
    `index.json` (`{"arrays": [[name, type, shape, offset], ...]}` or `{"error": words}` or
    `{"missing": [package, extra]}`) into the folder that is its first argument.

    Args:
        worker: its file's name.
        arguments: further ones.
        where: the log, for messages.
        memory: bytes that it may have.
        seconds: that it may take.

    Raises:
        InputError: it refused the file, or the file crashed it.
        MissingExtra: a package is missing.
    """
    with tempfile.TemporaryDirectory(prefix="auvnn-read-") as folder:
        command = [
            sys.executable,
            "-I",
            str(Path(__file__).with_name(worker)),
            folder,
            str(memory),
            *arguments,
        ]
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        try:
            ended = subprocess.run(
                command, capture_output=True, timeout=seconds, check=False, env=environment
            )
        except subprocess.TimeoutExpired:
            raise InputError(f"{where}: cannot be read within {seconds:.0f} s: damaged?") from None
        index = Path(folder) / "index.json"
        if not index.is_file():
            code = ended.returncode
            how = signal.Signals(-code).name if code < 0 else f"status {code}"
            raise InputError(
                f"{where}: is damaged: the library that reads it broke off ({how}); copy the file again"
            )
        told = json.loads(index.read_text())
        if "missing" in told:
            package, extra = told["missing"]
            raise MissingExtra(package, extra, "reading this file")
        if "error" in told:
            raise InputError(f"{where}: {told['error']}")
        size = (Path(folder) / "arrays.bin").stat().st_size
        if not size:
            return {}
        # Read by one call: a file of gigabytes is not kept twice.
        data = np.fromfile(Path(folder) / "arrays.bin", np.uint8)
        found = {}
        for name, kind, shape, offset in told["arrays"]:
            count = int(np.prod(shape)) * np.dtype(kind).itemsize
            found[name] = data[offset : offset + count].view(kind).reshape(shape)
        return found
