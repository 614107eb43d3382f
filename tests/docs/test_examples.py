"""The examples in docstrings of what users call: each is there, fits the signatures, and the short ones run."""

from __future__ import annotations

import ast
import inspect
import re
from typing import Any

import pytest

import auvnn
from auvnn import GreyBox, Log

pytestmark = pytest.mark.usefixtures("catalogue_as_before")

SUBJECTS: dict[str, Any] = {name: getattr(auvnn, name) for name in auvnn.__all__} | {
    "GreyBox.rollout": GreyBox.rollout,
    "Log.read": Log.read,
}
# What takes minutes, or files of many dives, runs in the tests of its own room.
LONG = {"adapt", "add", "diagnose", "diagnose_files", "fleet", "improve", "train", "train_files"}


def example(name: str) -> str:
    """Return the only example of a docstring."""
    text = inspect.getdoc(SUBJECTS[name]) or ""
    found = re.findall(r"^Example:\n    ```python\n(.*?)\n    ```$", text, re.MULTILINE | re.DOTALL)
    assert len(found) == 1, name
    return inspect.cleandoc(found[0])


@pytest.mark.parametrize("name", sorted(SUBJECTS))
def test_there_is_an_example_that_fits_the_signatures(name):
    calls = [
        node
        for node in ast.walk(ast.parse(example(name)))
        if isinstance(node, ast.Call) and re.fullmatch(r"auvnn(\.\w+)+", ast.unparse(node.func))
    ]
    assert calls
    for call in calls:
        subject: Any = auvnn
        for part in ast.unparse(call.func).split(".")[1:]:
            subject = getattr(subject, part)
        inspect.signature(subject).bind(*call.args, **{str(k.arg): k.value for k in call.keywords})


@pytest.mark.parametrize("name", sorted(set(SUBJECTS) - LONG))
def test_short_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(example(name), name, "exec"), {"auvnn": auvnn})
