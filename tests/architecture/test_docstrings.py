"""Public functions of three or more arguments say what each of them is."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).parents[2] / "auvnn"
MANY = 3


class Public(NamedTuple):
    """A public function, or a method of a public class."""

    name: str
    owner: str | None
    node: ast.FunctionDef

    @property
    def arguments(self) -> list[str]:
        """Their names, `self` and `cls` left out."""
        given = self.node.args
        static = any(isinstance(d, ast.Name) and d.id == "staticmethod" for d in self.node.decorator_list)
        names = [a.arg for a in [*given.posonlyargs, *given.args]]
        names = names[1:] if self.owner and not static else names
        return names + [a.arg for a in [*given.kwonlyargs, given.vararg, given.kwarg] if a is not None]

    @property
    def described(self) -> bool:
        """Whether the docstring has a section of arguments; that it names all of them the linter sees to."""
        return "Args:" in (ast.get_docstring(self.node) or "")


def overload(node: ast.FunctionDef) -> bool:
    """Whether this is a signature alone, which must not carry a docstring: the implementation below it does."""
    return any(isinstance(d, ast.Name) and d.id == "overload" for d in node.decorator_list)


def functions(trees: dict[str, ast.Module]) -> Iterator[Public]:
    """Yield public functions and methods."""
    for where, tree in trees.items():
        for node in tree.body:
            inside = node.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_") else []
            owner = node.name if isinstance(node, ast.ClassDef) else None
            for found in [node, *inside]:
                if (
                    isinstance(found, ast.FunctionDef)
                    and not found.name.startswith("_")
                    and not overload(found)
                ):
                    name = f"{owner}.{found.name}" if owner else found.name
                    yield Public(f"{where}: {name}", owner, found)


def undescribed(trees: dict[str, ast.Module]) -> list[str]:
    """Return the functions of many arguments that do not describe them.

    A method that replaces one of a base class, with the same arguments, is described there.
    """
    every = list(functions(trees))
    methods = {(f.owner, f.node.name): f for f in every if f.owner}
    bases = {
        node.name: [b.id for b in node.bases if isinstance(b, ast.Name)]
        for tree in trees.values()
        for node in tree.body
        if isinstance(node, ast.ClassDef)
    }

    def inherited(f: Public, owner: str | None) -> bool:
        for base in bases.get(owner or "", []):
            same = methods.get((base, f.node.name))
            if (same and same.described and same.arguments == f.arguments) or inherited(f, base):
                return True
        return False

    return [
        f.name for f in every if len(f.arguments) >= MANY and not f.described and not inherited(f, f.owner)
    ]


def test_public_functions_describe_their_arguments():
    trees = {
        str(path.relative_to(PACKAGE)): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(PACKAGE.rglob("*.py"))
    }
    assert len(list(functions(trees))) > 1000
    assert not undescribed(trees)


def test_one_without_is_found():
    text = '''
def f(a, b, c): "Add."
def g(a, b): "Add."
def h(a, *b, c):
    """Add.

    Args:
        a: one.
    """
class A:
    def m(self, a, b, c):
        """Add.

        Args:
            a: one.
        """
    def n(self, a, b): ...
class B(A):
    def m(self, a, b, c): ...
class C(A):
    def m(self, a, b, other): ...
class D(B):
    def m(self, a, b, c): ...
'''
    assert undescribed({"x.py": ast.parse(text)}) == ["x.py: f", "x.py: C.m"]
