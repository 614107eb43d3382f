"""What the page of the benchmark says about a plan: targets, rates, p-values where nothing is hidden, held-out falls."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from auvnn.report.pages.benchmark import PAGE, BenchmarkPage
from auvnn.report.pages.sections import outcomes
from auvnn.report.pages.sections.benchmark_rates import WORDS as NAMES
from auvnn.report.pages.sections.benchmark_rates import target_words
from auvnn.report.panels import NoData
from auvnn.report.plots.falls import HIGH, LOW, falls
from auvnn.report.plots.recovery import ALL
from auvnn.report.plots.uniformity import uniformity
from auvnn.report.view import View
from auvnn.studies.benchmark import summarise
from auvnn.studies.benchmark.counts.rates import NUMBERS, RATES
from tests.report.html_reading import PageText, broken_references, dangers

WORDS = BenchmarkPage(without=("confusion", "recovery", "coverage", "uniformity", "falls"))


def row(hidden: str, verdict: str, *missing: str, kind: str = "effect", **more: Any) -> dict[str, Any]:
    plain = {
        "vehicle": "rov95", "hidden": hidden, "size": "large", "noise": "realistic", "excitation": "multisine",
        "coefficients": "drawn", "kind": kind, "part": "one", "verdict": verdict, "missing": list(missing),
        "found": [{"verdict": verdict, "effects": list(missing)}], "seconds": 1.0, "fault": None, "errors": {},
    }  # fmt: skip
    return {**plain, **more}


def nulls(count: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(0)
    return [row("nothing", "adequate", kind="nothing", p_values={"tether": rng.uniform(), "waves": rng.uniform() ** 3})
            for _ in range(count)]  # fmt: skip


ROWS = [
    row("tether", "named", "tether", fall={"share": 0.95}), row("tether", "named", "tether", fall={"share": 0.85}),
    row("waves", "adequate", fall={"share": 0.0}), row("waves", "named", "waves", fall={"share": None}),
    row("tether+waves", "named", "waves", "tether", kind="several"),
    row("tether+waves", "named", "waves", kind="several"),
    row("stranger_a", "unknown", kind="stranger", axis="X", axes_true=["X"]),
    row("stranger_a", "named", "tether", kind="stranger"), *nulls(20),
]  # fmt: skip
PLAN = {
    "parts": {
        "one": {"targets": [{"rate": "named_first", "least": 0.9}, {"rate": "all_named", "least": 0.4}]}
    }
}


@pytest.fixture(scope="module")
def answer() -> Any:
    return summarise(ROWS, {"plan": PLAN})


def text(answer: Any, page: BenchmarkPage = WORDS) -> str:
    found = PageText(page.page(answer))
    assert found.faults == [] and dangers(found) == [] and broken_references(found) == []
    return found.text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{NARROW NO-BREAK SPACE}", " ")


def test_it_begins_with_the_targets(answer):
    said = text(answer)
    assert "1 of 2 targets are met. Missed in “one”, named first: 75 % (wanted at least 90 %)." in said
    assert "Of 2 logs that hide several effects, 1 got all names and no other." in said
    assert "Of 2 logs that hide something outside the catalogue, 1 were answered unknown." in said
    # What is hidden beside them does not count among single effects.
    assert "In 3 of 4 logs the hidden effect is named first" in said


def test_every_rate_has_a_name_in_words_and_few_missed_targets_are_told_first():
    assert set(NAMES) == {*RATES, *NUMBERS}
    missed = [
        {"part": f"p{k}", "rate": "named_first", "share": 0.5, "least": 0.9, "met": False} for k in range(9)
    ]
    (said,) = target_words(View({"targets": missed}))
    assert said.startswith("0 of 9 targets are met. Missed in “p0”, named first: 50") and said.endswith(
        "; and 6 others."
    )


def test_the_tables_hold_targets_rates_and_effects(answer):
    said = text(answer)
    low, high = stats.binomtest(3, 4).proportion_ci(method="wilson")
    ends = f"{100 * low:.1f} to {100 * high:.1f} %"
    assert f"one named first at least 90 % 75.0 % {ends} 4 missed" in said
    assert f"all named first 3 4 75.0 % {ends}" in said
    assert "tether 2 100 % 100 % 100 % 100 %" in said and "90 % 0" in said


def test_without_a_plan_there_is_nothing_of_it(answer):
    said = text(SimpleNamespace(rows=answer.rows, options={}, metrics=answer.metrics, table=[]))
    assert "targets are met" not in said and "Rates by part" not in said
    for junk in (None, 3, ["x", None], {"a": 1}, [{"met": "x", "share": "y"}]):
        odd = {k: junk for k in ("targets", "rates", "effects", "uniformity")}
        said = text(SimpleNamespace(rows=answer.rows, options={}, metrics={}, table=[], **odd))
        assert "What could not be shown" not in said and "None" not in said


def test_a_stranger_answered_unknown_is_right_and_several_are_not_in_the_confusion(answer):
    lines, columns, table = outcomes.confusion_counts(answer.rows)
    assert lines == ["tether", "waves", "stranger_a", "nothing"]
    counted = {(h, a): table[i, j] for i, h in enumerate(lines) for j, a in enumerate(columns) if table[i, j]}
    assert counted == {
        ("tether", "tether"): 2, ("waves", "adequate"): 1, ("waves", "waves"): 1, ("stranger_a", "unknown"): 1,
        ("stranger_a", "tether"): 1, ("nothing", "adequate"): 20,
    }  # fmt: skip
    assert [outcomes.right(r) for r in answer.rows[4:8]] == [True, False, True, False]
    assert [outcomes.flawless(r) for r in answer.rows[4:8]] == [True, False, True, False]


def test_the_figures_are_there_where_there_is_something_to_draw(answer):
    names = [plot.name for plot in PAGE.plots(View(answer))]
    assert names == ["confusion", "recovery", "coverage", "falls", "uniformity"]
    few = summarise([r for r in ROWS if r["kind"] != "nothing" and "fall" not in r], {})
    assert not {"falls", "uniformity"} & {plot.name for plot in PAGE.plots(View(few))}


def test_p_values_are_drawn_at_their_ranks():
    values = {"tether": [0.5, 0.1, 0.9, 0.01, 0.3], "waves": [0.02, 0.2, 0.04, 0.6, 0.03, 0.7], "few": [0.5]}
    left, right = uniformity(values).axes
    lines = [line for line in left.lines if len(line.get_xdata()) > 2]
    assert [len(line.get_xdata()) for line in lines] == [5, 6], "too few of one test are no line"
    np.testing.assert_allclose(lines[0].get_ydata(), sorted(values["tether"]))
    np.testing.assert_allclose(lines[0].get_xdata(), np.arange(1, 6) / 6)
    assert [t.get_text() for t in right.get_yticklabels()] == ["tether", "waves"]
    shares = [container.lines[0].get_xdata()[0] for container in right.containers]
    assert shares == pytest.approx([20.0, 50.0])
    with pytest.raises(NoData):
        uniformity({"few": [0.5, 0.2]})


def test_falls_have_their_medians_and_stay_in_the_panel():
    found = {"tether": {"medium": [0.5, 0.7], "large": [0.9]}, "waves": {"large": [-3.0]}}
    ax = falls(found, target=0.9).axes[0]
    assert [t.get_text() for t in ax.get_yticklabels()] == [ALL, "tether", "waves"]
    # Of 0.5, 0.7, 0.9 and -3: 0.6; of the first three: 0.7.
    assert [t.get_text() for t in ax.texts] == ["60 %", "70 %", "-300 %"]
    drawn = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in ax.lines])
    assert drawn.min() >= min(LOW, 0.0) and drawn.max() <= HIGH
    assert 90.0 in drawn
    with pytest.raises(NoData):
        falls({})
