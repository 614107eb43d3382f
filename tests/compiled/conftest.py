"""A cache folder of the tests' own, and no tests where there is nothing to compile with."""

from __future__ import annotations

import os

import pytest

from auvnn.compiled import toolchain


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """Keep what is compiled for the session, away from the user's cache."""
    folder = tmp_path_factory.mktemp("kernels")
    before = os.environ.get("AUVNN_CACHE")
    os.environ["AUVNN_CACHE"] = str(folder)
    yield folder
    if before is None:
        del os.environ["AUVNN_CACHE"]
    else:
        os.environ["AUVNN_CACHE"] = before


@pytest.fixture(scope="session")
def compiler():
    """Skip where there is no C compiler."""
    found = toolchain.compiler()
    if found is None:
        pytest.skip("no C compiler")
    return found
