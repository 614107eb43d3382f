"""The story stands first and nothing on a page misleads: what is folded, in which order, and what is not drawn."""

from __future__ import annotations

import numpy as np

from auvnn.report.pages.fleet import PAGE as FLEET
from auvnn.report.pages.sections.adaptation_words import early_words, off_words, ratio_words
from auvnn.report.pages.sections.diagnosis_words import MOST_ALIKE, _ranking_caption, in_question
from auvnn.report.pages.study import PAGE as STUDY
from auvnn.report.plots.error_against_horizon import error_against_horizon
from auvnn.report.plots.free_running import free_running
from auvnn.report.plots.ranking import in_order, ranking
from auvnn.report.view import View
from tests.report.report_fakes import candidates, comparison, drawer
from tests.report.test_fleet_page import dives, row
from tests.report.test_study_plots import PLANT, T, study


def test_what_is_not_the_story_is_folded_away():
    page = drawer("comparison").page(comparison(n=400))
    before, _, after = page.partition("<details")
    assert before.count("<figure") == 3 and "What was read and assumed" in after
    assert "--least:" in page and "min-width: var(--least)" in page


def test_candidates_are_drawn_in_the_order_of_their_bars_after_those_chosen():
    found = in_order(candidates(), [str(candidates()[2]["effect"])])
    assert found[0]["effect"] == candidates()[2]["effect"]
    shares = [c["explained"] for c in found[1:] if not c.get("needs")]
    assert shares == sorted(shares, reverse=True)
    texts = [t.get_text() for ax in ranking(candidates()).axes for t in ax.texts]
    assert texts.count("alike") <= 1


def test_of_many_effects_those_are_shown_that_somebody_would_confuse():
    names = [f"e{k}" for k in range(37)]
    table = np.eye(37)
    table[5, 30] = table[30, 5] = 0.95
    kept = in_question(names, table, ["e5"], [{"effect": "e5"}, {"effect": "e9"}])
    assert {5, 30, 9} <= set(kept) and len(kept) <= MOST_ALIKE
    assert in_question(names[:4], np.eye(4), [], []) == [0, 1, 2, 3]


def test_a_model_that_leaves_every_panel_is_said_not_drawn():
    figure = free_running(T, {"plant": PLANT, "networks": PLANT * 1.01, "zero damping": PLANT * 9 + 1})
    assert len(figure.axes[0].lines) == 2
    assert any("zero damping" in t.get_text() for t in figure.texts)
    alone = free_running(T, {"plant": PLANT, "zero damping": PLANT * 9 + 1})
    assert len(alone.axes[0].lines) == 2, "where nothing else is left to draw it is drawn"


def test_the_noise_floor_is_a_line_of_its_own():
    errors = {"0.5": 0.3, "5": 0.4}
    figure = error_against_horizon({"as given": errors}, errors, {"0.5": 0.02, "5": 0.03})
    assert "noise alone" in [t.get_text() for t in figure.legends[0].get_texts()]


def test_the_fleets_summary_names_every_parameter():
    rows = [
        row() | {"words": "net_buoyancy.force: changes"},
        *(row(n) | {"changes": False} for n in "XYZKMN"),
    ]
    told = " ".join(FLEET.brief(View({"trends": rows, "dives": dives(3), "failed": []})))
    assert all(f"net_buoyancy.{n} " in told for n in "XYZKMN")


def test_ours_is_said_once_and_wide_tables_are_turned():
    answer = study() | {"assumed": ["ours: a", "steps of 1 s", "ours: b", "as the paper: c"]}
    told = STUDY.assumed(View(answer))
    assert told == [
        ("As in the paper", "C"), ("Not in the paper, decided here", "1. A"), ("", "2. B"),
        ("Integration", "Steps of 1 s"),
    ]  # fmt: skip
    assert all(len(t.head) <= 8 for t in STUDY.tables(View(answer)))


def test_a_change_at_the_very_beginning_can_be_a_model_that_never_fitted():
    changes, history = [{"run": 0, "time": 102.0}], [{"run": 0, "t": [100.0, 100.05]}]
    assert "auvnn diagnose" in early_words(changes, history)[0]
    assert early_words([{"run": 0, "time": 130.0}], history) == [] and early_words([], history) == []
    assert (
        early_words([{"run": 1, "time": 102.0}], history) == [] and early_words(changes, [{"run": 0}]) == []
    )


def test_an_adaptation_that_saw_no_change_of_a_model_that_was_off_points_to_diagnose():
    assert ratio_words(1.0) == "the error is the same as that of the model without adaptation"
    assert "8\N{NO-BREAK SPACE}% larger than" in ratio_words(1.08) and "2.5 times that of" in ratio_words(2.5)
    assert "smaller than" in ratio_words(0.7) and "larger" in ratio_words(1.3)
    steps = {"one_step_rmse_du_m_s2_adapted": 0.7, "one_step_rmse_du_m_s2_unadapted": 1.0}
    assert "auvnn diagnose" in off_words({"frozen_5_s_error_ratio": 1.0, **steps})[0]
    assert off_words({"frozen_5_s_error_ratio": 0.99}) == []


def test_what_comes_nearest_stands_first_and_a_larger_share_of_another_is_explained():
    rows = [{"effect": name, "explained": share, "p_value": 0.01} for name, share in
            (("added_mass", 1.0), ("payload", 0.5), ("cg_offset", 0.1), ("tilted_vertical", 0.01))]  # fmt: skip
    nearest = ["cg_offset", "tilted_vertical"]
    ax = ranking(rows, nearest=nearest).axes[0]
    ticks = ax.get_yticklabels()
    assert [t.get_text() for t in ticks] == [*nearest, "added_mass", "payload"]
    assert [t.get_fontstyle() for t in ticks] == ["italic"] * 2 + ["normal"] * 2
    said = _ranking_caption(rows, [], nearest)
    assert (
        "In italics, and first: what comes nearest" in said and "Alone, added_mass explains more (100" in said
    )
    assert "Alone," not in _ranking_caption(rows, [], ["added_mass"]) and "italics" not in _ranking_caption(
        rows, []
    )
