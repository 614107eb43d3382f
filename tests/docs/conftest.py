"""What the pages show runs compiled, as users run it."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def engine(compiled_engine):
    """Use the compiled engine in every module of this folder."""
