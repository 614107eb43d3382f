"""The page of the study of several uncertainties, from numbers made up here: no study is run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from auvnn.report.pages.uncertainties import PAGE
from auvnn.report.panels import NoData
from auvnn.report.plots.identifiability import LEAST, identifiability
from auvnn.report.plots.swallowed import swallowed
from auvnn.studies.uncertainties import Uncertainties
from tests.report.html_reading import PageText, dangers


def row(effect: str, name: str, alone: float, together: float, networks: float | None) -> dict[str, Any]:
    return {
        "effect": effect, "parameter": name, "alone_over_prior": alone, "together_over_prior": together,
        "with_networks_over_prior": networks, "verdict": "identified" if together < 0.5 else "confounded",
        "verdict_with_networks": None if networks is None else "identified" if networks < 0.5 else "confounded",
    }  # fmt: skip


def manoeuvre(scale: float, share: float | None) -> dict[str, Any]:
    return {
        "parameters": [row("added_mass", "X", 0.01 * scale, 0.02 * scale, 0.3 * scale),
                       row("linear_damping", "<b>X</b>", 0.0, 0.08 * scale, None)],
        "groups": {"added_mass": {"own": 0.28, "damping": 0.57}, "damping": {"own": 0.4, "added_mass": 0.3}},
        "confounded_pairs": [{"first": "added_mass X", "second": "linear_damping X", "correlation": -0.93}],
        "condition_number": 780.0,
        "swallowed": {"net_buoyancy": {"share": share, "held_out": -3.0, "elsewhere": None, "each": {}}},
    }  # fmt: skip


def study(**changes: Any) -> Uncertainties:
    found = {"paper": manoeuvre(3.0, 0.97), "multisine": manoeuvre(1.0, 0.84)}
    return Uncertainties("rov95", 0.5, 120.0, found, **changes)


def read(**changes: Any) -> tuple[str, PageText]:
    html = PAGE.page({**vars(study(**changes)), "story": study().story})
    return html, PageText(html)


def test_the_page_says_what_was_found_and_draws_both_figures():
    html, page = read()
    assert not page.faults and not dangers(page)
    assert html.count("<svg") == 2 and "could not be drawn" not in html
    assert "rov95: paper, multisine" in page.text
    # One of two is known on the paper's manoeuvre once networks are the damping, both without them.
    assert "identified with all uncertain at once: paper 2 of 2, multisine 2 of 2." in page.text
    assert "of those that are not damping: paper 0 of 1, multisine 1 of 1." in page.text
    assert "absorb of an effect: paper 97 %, multisine 84 %." in page.text
    assert "paper: 2 of 2 parameters are identified together" in page.text


def test_its_tables_hold_the_numbers():
    _, page = read()
    for number in ("0.06", "0.9", "0.24", "0.93", "28 %", "57 %"):
        assert number in page.text, number


def test_names_stay_text():
    html, page = read()
    assert "<b>X</b>" not in html and "<b>X</b>" in page.text


def test_what_was_not_trained_is_left_out_and_the_rest_is_there():
    found = study()
    for one in found.manoeuvres.values():
        one["swallowed"] = {}
    html = PAGE.page({**vars(found), "story": found.story})
    assert html.count("<svg") == 1 and "no network was trained" in PageText(html).text


def test_swallowed_writes_each_share_and_counts_less_than_nothing_as_nothing():
    figure = swallowed({"paper": {"a": 0.97, "b": None}, "multisine": {"a": -3.0, "b": 0.5}})
    assert [t.get_text() for t in figure.axes[0].texts] == ["0.97", "0.00", "–", "0.50"]
    for text in figure.axes[0].texts:
        assert text.get_color() in ("black", "white")


def test_identifiability_places_every_parameter_and_cuts_at_the_axis():
    rows = manoeuvre(1.0, None)["parameters"]
    figure = identifiability({"paper": rows})
    alone, together, networks = figure.axes[0].lines
    np.testing.assert_allclose(alone.get_xdata(), [0.01, LEAST])
    np.testing.assert_allclose(together.get_xdata(), [0.02, 0.08])
    assert np.isnan(networks.get_xdata()[1]) and networks.get_xdata()[0] == 0.3
    assert len(figure.axes[0].get_yticks()) == 2


@pytest.mark.parametrize(
    "draw", [lambda: swallowed({}), lambda: identifiability({}), lambda: identifiability({"a": []})]
)
def test_nothing_to_draw_is_told(draw):
    with pytest.raises(NoData):
        draw()
