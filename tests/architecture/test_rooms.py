"""Rooms and files stay small enough to be read: 300 lines a file, 15 files a room, and each room says what it is for."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "auvnn"
LONGEST, MOST = 300, 15
# One small file for each member: as many as there are members.
CATALOGUES = {"cli/verbs", "effects", "exports", "logs/readers", "report/plots"}
ROOMS = sorted({path.parent for path in PACKAGE.rglob("*.py")})


def too_long(folder: Path) -> list[str]:
    """Return the files that have more lines than one reads at a stretch."""
    counts = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in folder.rglob("*.py")}
    return [f"{path.relative_to(folder)}: {n} lines" for path, n in sorted(counts.items()) if n > LONGEST]


def files_of(room: Path) -> list[str]:
    """Return the modules of a room, but for its `__init__`."""
    return sorted(path.stem for path in room.glob("*.py") if path.name != "__init__.py")


def test_no_file_is_too_long():
    assert not too_long(PACKAGE), "divide these by subject"


def test_a_file_that_is_too_long_is_found(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\n" * LONGEST)
    (tmp_path / "b.py").write_text("x = 1\n" * (LONGEST + 1))
    assert too_long(tmp_path) == [f"b.py: {LONGEST + 1} lines"]


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(PACKAGE)))
def test_a_room_holds_few_files_and_says_what_for(room):
    init = room / "__init__.py"
    name = room.relative_to(PACKAGE).as_posix()
    if name not in CATALOGUES:
        assert len(files_of(room)) <= MOST, f"{name}: divide it into inner rooms"
    assert init.is_file() and ast.get_docstring(ast.parse(init.read_text(encoding="utf-8"))), name


def test_only_rooms_with_many_members_are_called_catalogues():
    assert {name for name in CATALOGUES if len(files_of(PACKAGE / name)) > MOST} == CATALOGUES
