"""Every row of the list of bad input has a test, and every test that the list names is there and is run."""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

import pytest

from auvnn.docs import page
from tests.faults.rows import ELSEWHERE, ROWS, table

ROOT = Path(__file__).parents[2]
NUMBERED = re.compile(r"test_row_(\d+)_\w+")


@functools.cache
def functions_of(file: Path) -> dict[str, ast.FunctionDef]:
    """The test functions of a file by name."""
    return {
        node.name: node
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }


def here() -> dict[int, list[str]]:
    """Tests of this folder, by row."""
    found: dict[int, list[str]] = {}
    for file in sorted(Path(__file__).parent.glob("test_*.py")):
        for name in functions_of(file):
            if match := NUMBERED.fullmatch(name):
                found.setdefault(int(match[1]), []).append(name)
    return found


def asserts(function: ast.FunctionDef) -> bool:
    """Whether a test can fail: it asserts, expects an error, or calls something of the kind by name."""
    calls = {ast.unparse(n.func) for n in ast.walk(function) if isinstance(n, ast.Call)}
    judging = {"pytest.raises", "refused", "use", "same", "noted", "assert_survives"}
    return any(isinstance(n, ast.Assert) for n in ast.walk(function)) or any(
        c in judging or c.startswith(("np.testing.", "torch.testing.")) for c in calls
    )


@pytest.mark.parametrize("row", ROWS)
def test_every_row_has_a_test(row):
    assert here().get(row) or ELSEWHERE.get(row), f"row {row}, {ROWS[row]}, has no test"


def test_no_test_is_for_a_row_that_is_not_listed():
    assert set(here()) | set(ELSEWHERE) <= set(ROWS)


@pytest.mark.parametrize("node", sorted({node for nodes in ELSEWHERE.values() for node in nodes}))
def test_every_test_named_is_there_and_can_fail(node):
    file, _, name = node.partition("::")
    assert (ROOT / file).is_file(), node
    function = functions_of(ROOT / file).get(name)
    assert function is not None, f"{file} has no {name}"
    marks = " ".join(ast.unparse(d) for d in function.decorator_list if "os.name" not in ast.unparse(d))
    assert not re.search(r"skip|xfail|mark\.long|mark\.data", marks) and asserts(function)


def test_every_test_of_this_folder_can_fail():
    for file in sorted(Path(__file__).parent.glob("test_*.py")):
        for name, function in functions_of(file).items():
            assert asserts(function), f"{file.name}::{name} asserts nothing"


def test_the_list_is_whole():
    assert list(ROWS) == list(range(1, 113))


def test_the_table_names_a_test_for_each_row():
    lines = table().splitlines()
    rows = [n for n, line in enumerate(lines) if re.match(r" {0,2}\d+  ", line)]
    assert len(rows) == 112 and all("::" in lines[n + 1] for n in rows)


def test_the_page_says_for_each_row_what_the_user_gets():
    rows = re.findall(r"^\| (\d+) \| [^|]+ \| [^|]+ \| `(tests/[^`|]+)` \|$", page("faults"), re.MULTILINE)
    assert [int(n) for n, _ in rows] == list(range(1, 113))
    listed = here()
    for number, node in rows:
        file, _, name = node.partition("::")
        assert node in ELSEWHERE.get(int(number), []) or name in listed.get(int(number), []), node
        assert name in functions_of(ROOT / file), node


def test_each_promise_on_safety_has_its_test():
    named = re.findall(r"\| `(tests/[^`]+)` \|$", page("security"), re.MULTILINE)
    assert len(named) > 15
    for node in named:
        file, _, name = node.partition("::")
        assert (ROOT / file).is_file(), node
        assert not name or name in functions_of(ROOT / file), node
