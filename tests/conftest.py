"""What all tests share: one thread (the tensors are small), shape checking on demand, and coarse pictures."""

import os
import tempfile

# AUVNN_CHECK_SHAPES=1 checks every shape in every call of the physics, at five times the cost of a call.
# tests/physics/test_properties.py checks the shapes of each function once, always.
if os.environ.get("AUVNN_CHECK_SHAPES") == "1":
    from jaxtyping import install_import_hook

    install_import_hook("auvnn.physics", "beartype.beartype")

# What is compiled, and when, is for tests/compiled to ask; elsewhere nothing is left in anybody's cache.
os.environ.setdefault("AUVNN_ENGINE", "torch")
# Diagnoses run the same few models free a thousand times: their machine code is kept for all workers, until the end.
if "AUVNN_CACHE" not in os.environ:
    KERNELS = tempfile.TemporaryDirectory(prefix="auvnn-kernels-")
    os.environ["AUVNN_CACHE"] = KERNELS.name

import pytest
import torch

torch.set_num_threads(1)

from auvnn.effects import EFFECTS  # noqa: E402
from auvnn.report import page, style  # noqa: E402

# Hundreds of figures are written to files that no test looks at closely: those that do draw their own. Where parts of a
# figure lie, which is half of the time that it takes, is for tests of plots to ask, and of one page of each kind.
page.FILE_DPI = 40
LAID_OUT = style.settle


def unsettled(figure):
    """Take away what would lay a figure out, and leave its parts where they are."""
    figure.set_layout_engine("none")
    return figure


@pytest.fixture(scope="module")
def compiled_engine():
    """Run models as users do, compiled: for tests that run the same model freely a thousand times."""
    before = os.environ["AUVNN_ENGINE"]
    if before == "torch":
        os.environ["AUVNN_ENGINE"] = "auto"
    yield
    os.environ["AUVNN_ENGINE"] = before


@pytest.fixture(scope="module")
def laid_out_figures():
    """Lay figures out as they are for users, instead of leaving their parts where they are first put."""
    style.settle = LAID_OUT
    yield
    style.settle = unsettled


style.settle = unsettled


@pytest.fixture
def catalogue_as_before():
    """Forget afterwards what a test adds to the catalogue of effects, which all tests of a process share."""
    before = dict(EFFECTS._added)
    yield
    EFFECTS._added.clear()
    EFFECTS._added.update(before)
