"""The pages of the documentation, shipped with the package: Markdown files in this folder, one subject each."""

from __future__ import annotations

from pathlib import Path

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError

FOLDER = Path(__file__).parent
START = "index"


def page_names() -> list[str]:
    """Return the names of all pages, the first to read before the others in alphabetical order."""
    names = sorted(path.stem for path in FOLDER.glob("*.md"))
    return [START, *(name for name in names if name != START)]


def page(name: str = START) -> str:
    """Return a page as Markdown.

    Args:
        name: of the page, without its ending.

    Raises:
        ConfigError: there is no such page.
    """
    if name not in page_names():
        raise ConfigError(unknown_name("page", name, page_names()))
    return (FOLDER / f"{name}.md").read_text(encoding="utf-8")


def title(name: str) -> str:
    """Return the heading of a page."""
    return page(name).splitlines()[0].lstrip("# ").strip()
