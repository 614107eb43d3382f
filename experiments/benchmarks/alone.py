"""Imported before anything else: one thread on one core, and no code that was compiled before."""

from __future__ import annotations

import os
import tempfile

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[_name] = "1"
_folder = tempfile.TemporaryDirectory(prefix="auvnn-benchmark-")
os.environ["AUVNN_CACHE"] = _folder.name
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

CACHE = _folder.name
