"""What all tests share: one thread (the tensors are small), shape checking on demand, and coarse pictures."""

import os
import tempfile
from pathlib import Path

# AUVNN_CHECK_SHAPES=1 checks every shape in every call of the physics, at five times the cost of a call.
# tests/physics/test_properties.py checks the shapes of each function once, always.
if os.environ.get("AUVNN_CHECK_SHAPES") == "1":
    from jaxtyping import install_import_hook

    install_import_hook("auvnn.physics", "beartype.beartype")

# What is compiled, and when, is for tests/fast to ask; elsewhere nothing is left in anybody's cache.
os.environ.setdefault("AUVNN_ENGINE", "torch")
# Diagnoses run the same few models free a thousand times: their machine code is kept for all workers, until the end.
if "AUVNN_CACHE" not in os.environ:
    KERNELS = tempfile.TemporaryDirectory(prefix="auvnn-kernels-")
    os.environ["AUVNN_CACHE"] = KERNELS.name
COMPILED = ("diagnosis", "simulate", "studies")

import pytest  # noqa: E402
import torch  # noqa: E402

torch.set_num_threads(1)

from auvnn.report import page  # noqa: E402

# Hundreds of figures are written to files that no test looks at closely: those that do draw their own.
page.FILE_DPI = 40


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item):
    """Run what runs free a thousand times as users do, compiled."""
    before = os.environ["AUVNN_ENGINE"]
    if before == "torch" and Path(item.fspath).parent.name in COMPILED:
        os.environ["AUVNN_ENGINE"] = "auto"
    yield
    os.environ["AUVNN_ENGINE"] = before
