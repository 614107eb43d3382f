"""The page of a diagnosis that leads with a group and names more beside it."""

import pytest

from auvnn.report.pages.diagnosis import PAGE
from tests.report.html_reading import PageText
from tests.report.report_fakes import NAMES, diagnosis


def page(steps: list[tuple[str, list[str]]]) -> str:
    told = [{"verdict": verdict, "effects": effects} for verdict, effects in steps]
    answer = diagnosis("ambiguous", steps=told, missing=told[0]["effects"])
    return PageText(PAGE.page(answer)).text


GROUP = ("ambiguous", ["ocean_current", "constant_force"])


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ([("named", [NAMES[2]]), ("adequate", [])], True),
        ([("adequate", [])], False),
        ([("named", [NAMES[2]]), ("withdrawn", [NAMES[2]]), ("adequate", [])], False),
    ],
)
def test_what_was_found_beside_a_group_is_told_and_what_was_withdrawn_is_not(more, told):
    text = page([GROUP, *more])
    assert "cannot tell which: ocean_current or constant_force" in text
    assert (f"Besides, it lacks {NAMES[2]}." in text) == told
