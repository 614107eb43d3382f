"""A folder of a stranger: files with the names of modules that leave a line when they are run."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import auvnn

NAMES = (
    "auvnn", "typing", "numpy", "json", "pickle", "multiprocessing", "ray", "distributed", "dask", "torch", "asyncio",
    "hydra", "omegaconf", "yaml", "polars", "scipy", "joblib", "submitit", "cloudpickle", "subprocess", "hydra_plugins",
    "sitecustomize", "usercustomize", "runpy", "tempfile",
)  # fmt: skip
PACKAGE = str(Path(auvnn.__file__).parents[1])


def poisoned(folder: Path) -> Path:
    """Fill a folder, and return the file that says which of its modules were run."""
    ran = folder.parent / "ran.txt"
    line = f"open({str(ran)!r}, 'a').write(__name__ + chr(10))\nraise ImportError('poison')\n"
    for name in NAMES:
        (folder / f"{name}.py").write_text(line)
    return ran


def outside(**more: str) -> dict[str, str]:
    """The environment of a command that somebody types: the package installed, nothing else in the search path."""
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONSAFEPATH", "PYTHONPATH")}
    # The folder of the installed package stands last, as site-packages do.
    paths = [p for p in sys.path if p and os.path.realpath(p) != os.path.realpath(os.getcwd())]
    return kept | {"PYTHONPATH": os.pathsep.join([*paths, PACKAGE]), "OMP_NUM_THREADS": "1"} | more
