"""The plot over dives, and what a diagnosis page says about all of a long log."""

from __future__ import annotations

from typing import Any

import pytest

from auvnn.report.pages.diagnosis import PAGE
from auvnn.report.panels import NoData
from auvnn.report.plots.over_dives import MOST, over_dives
from auvnn.report.view import View


def dives(count: int, verdict: str = "adequate") -> list[dict[str, Any]]:
    entry = {
        "force": {"value": 1.0, "std": 0.1, "unit": "N"},
        "other": {"value": 2.0, "std": None, "unit": "N"},
    }
    return [
        {"dive": k, "days": 3.0 * k, "verdict": verdict, "parameters": {"net_buoyancy": entry}}
        for k in range(count)
    ]


def row(name: str = "force", slope: float | None = 0.1) -> dict[str, Any]:
    return {
        "effect": "net_buoyancy", "parameter": name, "unit": "N", "changes": True,
        "mean": {"value": 1.0, "std": 0.1}, "constancy": {"p_value": 1e-9},
        "slope": {"value": slope, "std": 0.01}, "line": {"middle": 4.0, "level": 1.0, "std": 0.1},
    }  # fmt: skip


def test_every_parameter_with_values_has_a_panel_with_unit_and_verdict():
    figure = over_dives(dives(4), [row(), row("other")], "date", "2026-05-10T00:00:00")
    (ax,) = figure.axes  # what has no standard error has no panel
    assert ax.get_xlabel() == "days since 2026-05-10" and ax.get_ylabel() == "N"
    assert "net_buoyancy  force: changes" in ax.get_title("left")
    legend = [t.get_text() for t in figure.legends[0].get_texts()]
    assert legend == ["dive, 95 % interval", "weighted mean", "line, 95 % band"]


def test_dives_with_more_unexplained_are_hollow_and_two_dives_have_no_line():
    figure = over_dives([*dives(1), *dives(2, "unknown")[1:]], [row(slope=None)], "dive")
    assert figure.axes[0].get_xlabel() == "dive"
    legend = [t.get_text() for t in figure.legends[0].get_texts()]
    assert "dive with more unexplained" in legend and "line, 95 % band" not in legend


def test_no_more_panels_than_a_page_bears_and_none_without_values():
    assert len(over_dives(dives(3), [row()] * (MOST + 3), "dive").axes) == MOST
    with pytest.raises(NoData):
        over_dives([], [row()], "dive")


def test_the_diagnosis_page_says_what_all_of_a_long_log_says():
    value = {"v_north": {"value": 0.2, "std": 0.01, "unit": "m/s"}}
    whole = {
        "files": 3, "samples": 1_000_000, "windows": 10_000, "looked_at": 2000, "adequate": False,
        "searched": {"words": "the search ran on 240 of 10000 windows"},
        "candidates": [{"effect": "ocean_current", "p_value": 1e-30, "evidence": 812.0, "inflation": 1.4}],
        "parameters": {"ocean_current": value}, "coefficients": {},
    }  # fmt: skip
    data = {
        "schema": "auvnn/diagnosis/1",
        "verdict": "named",
        "missing": ["ocean_current"],
        "whole_log": whole,
    }
    tests, values = (t for t in PAGE.tables(View(data)) if t.title.startswith("On all of the log"))
    assert tests.rows[0][0] == "ocean_current" and "240 of 10000" in tests.caption and "2" in tests.caption
    assert values.rows[0][:2] == ["ocean_current", "v_north"] and "slower than white noise" in values.caption
    assert not [t for t in PAGE.tables(View({**data, "whole_log": None})) if t.title.startswith("On all")]
