"""Simulations run compiled, as users run them."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def engine(compiled_engine):
    """Use the compiled engine in every module of this folder."""
