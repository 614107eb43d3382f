"""No module of the package needs itself: imports inside functions count, those for types alone do not."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "auvnn"


def modules() -> dict[str, Path]:
    """Return every module by its dotted name; a package stands for its `__init__`."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


class _Imports(ast.NodeVisitor):
    """Modules that a file imports anywhere but under `if TYPE_CHECKING`."""

    def __init__(self, known: dict[str, Path]) -> None:
        self.known, self.found = known, set()

    def visit_If(self, node: ast.If) -> None:
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            for other in node.orelse:
                self.visit(other)
        else:
            self.generic_visit(node)

    def visit_Import(self, node: ast.Import) -> None:
        self.found |= {alias.name for alias in node.names if alias.name in self.known}

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        for alias in node.names:
            whole = f"{node.module}.{alias.name}"
            name = whole if whole in self.known else node.module
            if name in self.known:
                self.found.add(name)


def imports_of(known: dict[str, Path]) -> dict[str, set[str]]:
    """Return what each module imports."""
    graph = {}
    for name, path in known.items():
        visitor = _Imports(known)
        visitor.visit(ast.parse(path.read_text(encoding="utf-8")))
        graph[name] = visitor.found - {name}
    return graph


def test_no_module_imports_itself_by_way_of_others():
    try:
        TopologicalSorter(imports_of(modules())).prepare()
    except CycleError as error:
        raise AssertionError("an import circle: " + " -> ".join(error.args[1])) from None


def test_a_circle_through_a_function_is_found(tmp_path):
    (tmp_path / "a.py").write_text("def f():\n    from b import g\n")
    (tmp_path / "b.py").write_text("import a\n")
    known = {"a": tmp_path / "a.py", "b": tmp_path / "b.py"}
    graph = imports_of(known)
    assert graph == {"a": {"b"}, "b": {"a"}}
    (tmp_path / "a.py").write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from b import g\n"
    )
    assert imports_of(known) == {"a": set(), "b": {"a"}}
