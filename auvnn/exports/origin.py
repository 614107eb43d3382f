"""What files say about where they come from."""

from importlib.metadata import PackageNotFoundError, version


def _version() -> str:
    try:
        return version("auvnn")
    except PackageNotFoundError:  # run from a checkout that was never installed
        return "(not installed)"


ORIGIN = f"auvnn {_version()}"
