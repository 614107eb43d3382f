"""The page of the benchmark and its three plots: what they count, and that they survive what they are given."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from auvnn.answers import DRAWERS
from auvnn.report.html import SECURITY
from auvnn.report.pages.benchmark import PAGE, BenchmarkPage
from auvnn.report.plots.confusion import OUTCOMES
from auvnn.report.view import View
from tests.report.fake_signals import HOSTILE
from tests.report.html_reading import PageText, broken_references, dangers

EFFECTS = ["ocean_current", "cg_offset", "thruster_lag"]
# The page without its figures, where its words are read: drawing takes most of the time.
WORDS = BenchmarkPage(without=("confusion", "recovery", "coverage", "recovery_1", "recovery_2"))
METRICS = {"logs": 34, "false_discovery_share": 2 / 26, "coverage_95_share": None, "median_seconds": 12.34}


def row(hidden: str, verdict: str, *missing: str, **more: Any) -> dict[str, Any]:
    plain = {
        "vehicle": "rov95", "hidden": hidden, "size": "none" if hidden == "nothing" else "medium",
        "noise": "realistic", "excitation": "multisine", "coefficients": "exact", "seed": 1000, "runs": 4,
        "duration": 60.0, "rate": 20.0, "verdict": verdict, "missing": list(missing), "p_value": 1e-6,
        "ranking": EFFECTS, "seconds": 10.0, "fault": None, "errors": {},
    }  # fmt: skip
    return {**plain, **more}


def right(hidden: str, k: int, **more: Any) -> dict[str, Any]:
    z = float(stats.norm.ppf((k + 0.5) / 10))
    errors = {"a": {"relative": 0.02 + 0.001 * k, "z": z}, "b": {"relative": 0.01, "z": -z}}
    return row(hidden, "named", hidden, errors=errors, seed=1000 + k, **more)


def rows(**more: Any) -> list[dict[str, Any]]:
    """Return 30 logs of three effects, 24 of them right, and 4 with nothing, 3 of them right."""
    current = [right("ocean_current", k, **more) for k in range(10)]
    offset = [right("cg_offset", k, size="large", **more) for k in range(8)]
    offset += [row("cg_offset", "ambiguous", "thruster_lag", "cg_offset", **more),
               row("cg_offset", "unknown", **more)]  # fmt: skip
    lag = [right("thruster_lag", k, **more) for k in range(6)]
    lag += [row("thruster_lag", "named", "ocean_current", **more), row("thruster_lag", "adequate", **more),
            row("thruster_lag", "named", "ocean_current", **more),
            row("thruster_lag", "fault", fault="the model diverges in run 2", ranking=None, **more)]  # fmt: skip
    nothing = [row("nothing", "adequate", **more) for _ in range(3)] + [row("nothing", "unknown", **more)]
    return [*current, *offset, *lag, *nothing]


def fake(some: list[dict[str, Any]] | None = None, **more: Any) -> SimpleNamespace:
    """Return an answer as the study gives it."""
    table = [
        {"vehicle": "rov95", "hidden": "cg_offset", "size": "large", "noise": "realistic", "excitation": "multisine",
         "logs": 10, "named_first": 8, "in_group": 9, "answers": {"unknown": 1, "cg_offset": 8, "ambiguous": 1},
         "worst_relative_error": 0.027},
        {"vehicle": "rov95", "hidden": "nothing", "size": "none", "noise": "realistic", "excitation": "multisine",
         "logs": 4, "named_first": 0, "in_group": 0, "answers": {"adequate": 3, "unknown": 1},
         "worst_relative_error": None},
    ]  # fmt: skip
    plain = {
        "rows": rows() if some is None else some,
        "options": {"repeats": 10},
        "metrics": METRICS,
        "table": table,
    }
    return SimpleNamespace(**{**plain, **more})


def cells(ax: Any) -> dict[tuple[float, float], str]:
    return {t.get_position(): t.get_text() for t in ax.texts}


def text(answer: Any, page: BenchmarkPage = WORDS) -> str:
    found = PageText(page.page(answer))
    assert found.faults == [] and dangers(found) == [] and broken_references(found) == []
    return found.text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{NARROW NO-BREAK SPACE}", " ")


@pytest.fixture(scope="module")
def html() -> str:
    return PAGE.page(fake())


def test_the_answer_finds_its_page_by_name():
    assert DRAWERS.get("benchmark") is PAGE and PAGE.kind == "benchmark"


def test_the_page_is_complete_inert_and_light(html):
    page = PageText(html)
    assert dangers(page) == [] and broken_references(page) == [] and page.faults == []
    assert [m["content"] for m in page.named("meta") if m.get("http-equiv")] == [SECURITY]
    assert "There is no figure here" not in page.text and "What could not be shown" not in page.text
    assert "nan" not in page.text.lower().split() and "None" not in page.text
    assert len(html.encode()) < 1_500_000


def test_it_begins_with_three_to_six_sentences(html):
    box = re.search(r'<section class="short".*?</section>', html, re.S).group()
    sentences = re.findall(r"<p>(.*?)</p>", box, re.S)
    assert 3 <= len(sentences) <= 6 and all(s.endswith(".") for s in sentences)
    assert html.index('class="short"') < html.index("<figure")
    assert html.rindex("</figure>") < html.index("<table")


def test_it_says_what_was_counted():
    low, high = stats.binomtest(24, 30).proportion_ci(method="wilson")
    said = text(fake())
    assert (
        f"In 24 of 30 logs the hidden effect is named first (80 %; 95 % interval {100 * low:.0f} to " in said
    )
    assert f"to {100 * high:.0f} %); in 1 more it is in a group that the log cannot tell apart." in said
    assert (
        "Most often missed is thruster_lag, 4 of 10 logs; answered: ocean_current (2) and adequate (1)."
        in said
    )
    assert "With nothing hidden, 3 of 4 logs are found adequate (75 %" in said
    # 24 right ones and two wrong.
    assert "Wrong names: 8 % of the 26 that were given." in said
    assert "For 48 of 48 parameters (100 %) the 95 % interval holds the true value" in said
    assert "relative to the effect's size the largest error is 3 % with noise realistic." in said
    assert "1 log ended in a fault instead of an answer." in said
    assert "4 runs of 60 s at 20 Hz" in said and "1000 to 1009" in said


def test_it_says_what_it_cannot_know():
    said = text(fake([r for r in rows() if r["hidden"] != "nothing"]))
    assert "this says nothing of false alarms" in said
    said = text(fake([r for r in rows() if r["hidden"] == "nothing"]))
    assert "this says nothing of how often one is found" in said and "No effect is named in any log." in said


def test_exact_coefficients_are_a_caveat():
    assert "exactly those of the model" in text(fake())
    assert "exactly those of the model" not in text(fake(rows(coefficients="drawn")))


def test_without_metrics_wrong_names_are_counted_from_the_rows():
    assert "Wrong names: 8 % of the 26 that were given." in text(fake(metrics=None))


def test_every_log_that_was_not_answered_right_is_listed():
    page = WORDS.page(fake())
    listed = re.search(r"Logs that were not answered right.*?</table>", page, re.S).group()
    lines = re.findall(r"<tr><th scope=\"row\">(.*?)</th><td[^>]*>(.*?)</td>", listed)
    assert sorted(lines) == sorted([
        ("cg_offset", "ambiguous: thruster_lag or cg_offset"), ("cg_offset", "unknown"),
        ("thruster_lag", "ocean_current"), ("thruster_lag", "ocean_current"), ("thruster_lag", "adequate"),
        ("thruster_lag", "fault: the model diverges in run 2"), ("nothing", "unknown"),
    ])  # fmt: skip


def test_a_name_too_many_is_not_right():
    page = WORDS.page(fake([row("cg_offset", "named", "cg_offset", "thruster_lag")]))
    assert "cg_offset and thruster_lag" in page[page.index("Logs that were not answered right") :]


def test_the_tables_hold_the_counts():
    said = text(fake())
    assert "rov95 realistic multisine 30 24 (80 %) 25 (83 %) 3 % 4 3 (75 %) 1" in said
    assert "cg_offset large cg_offset 8, unknown 1, ambiguous 1 10 8 9 3 %" in said
    assert "nothing none adequate 3, unknown 1 4 – – –" in said
    table = [*fake().table, {**fake().table[0], "noise": "none", "vehicle": "rov90"}]
    said = text(fake(table=table))
    assert "hidden size vehicle noise answers logs" in said
    assert "cg_offset large rov90 none cg_offset 8" in said


def test_rows_that_differ_in_nothing_that_is_shown_are_one():
    first = fake().table[0]
    said = text(fake(table=[first, {**first, "plant": "mujoco", "worst_relative_error": 0.5}]))
    assert "cg_offset large cg_offset 16, unknown 2, ambiguous 2 20 16 18 50 %" in said


def test_a_group_that_holds_the_hidden_effect_is_not_missed():
    some = [row("cg_offset", "ambiguous", "thruster_lag", "cg_offset"), row("thruster_lag", "unknown")]
    assert "Most often missed is thruster_lag, 1 of 1 logs; answered: unknown (1)." in text(fake(some))
    assert "Most often missed" not in text(fake(some[:1]))


def test_sizes_say_what_they_are_measured_in_and_rise():
    some = [right("cg_offset", k, size=size) for k, size in enumerate(("150%", "15%", "40%"))]
    said = text(fake(some, options={"repeats": 10, "plan": {"parts": {}}}))
    # A plan's parts each have a number of logs of their own.
    assert "15 %, 40 % and 150 %" in said and "Of each kind" not in said
    captions = {plot.name: plot.caption for plot in PAGE.plots(View(fake(some)))}
    assert "of the 5 s error" in captions["recovery"]
    captions = {plot.name: plot.caption for plot in PAGE.plots(View(fake()))}
    assert "standard errors of a fit" in captions["recovery"] and "Of each kind 10 logs" in text(fake())


def test_several_conditions_get_a_figure_each():
    both = fake([*rows(), *rows(noise="none")])
    assert list(PAGE.figures(both)) == ["confusion", "recovery", "coverage", "recovery_1", "recovery_2"]
    titles = [plot.title for plot in PAGE.plots(View(both))]
    assert "Named first: rov95, noise none, manoeuvre multisine" in titles
    assert list(PAGE.figures(fake())) == ["confusion", "recovery", "coverage"]


def test_the_page_counts_as_the_study_does():
    from auvnn.report.pages.sections import outcomes
    from auvnn.studies.benchmark import in_group, named_first, summarise

    more = {"errors": {"x": {"relative": 0.5, "z": 3.0}}}
    some = [
        *rows(),
        row("cg_offset", "named"),
        row("cg_offset", "named", "cg_offset", "thruster_lag", **more),
    ]
    some.append(row("cg_offset", "ambiguous", "thruster_lag", "ocean_current"))
    hidden = outcomes.with_effect(some)
    assert [outcomes.right(r) for r in hidden] == [named_first(r) for r in hidden]
    assert [outcomes.right(r) or outcomes.in_group(r) for r in hidden] == [in_group(r) for r in hidden]
    answer = summarise(some, {})
    z = outcomes.errors(some, "z")
    assert np.mean(np.abs(z) < 1.96) == answer.metrics["coverage_95_share"]
    assert outcomes.errors(some, "relative").max() == answer.metrics["worst_relative_error"]


def test_the_figures_hold_the_counts():
    figures = PAGE.figures(fake())
    shown = [t.get_text() for t in figures["recovery"].axes[0].texts]
    # Medium, then large: of all, of the current, of the offset's ten logs eight are large, of the lag.
    assert shown == ["16 of 22", "8 of 8", "10 of 10", "0 of 2", "8 of 8", "6 of 10"]
    ax = figures["confusion"].axes[0]
    assert [t.get_text() for t in ax.get_xticklabels()] == [*EFFECTS, *OUTCOMES]
    assert [t.get_text() for t in ax.get_yticklabels()] == [*EFFECTS, "nothing"]
    lines = [[shown for (_, at), shown in cells(ax).items() if at == y] for y in ax.get_yticks()]
    assert lines == [["10", "10"], ["8", "1", "1", "10"], ["2", "6", "1", "1", "10"], ["1", "3", "4"]]
    assert "48 of 48" in figures["coverage"].axes[0].get_title("left")


def test_a_benchmark_is_written_with_its_figures(tmp_path):
    from auvnn.studies.benchmark import summarise

    answer = summarise(rows(), {"repeats": 10})
    assert answer.write(tmp_path) == tmp_path / "benchmark.json"
    assert {p.name for p in (tmp_path / "figures").iterdir()} == {
        f"{name}.{kind}" for name in ("confusion", "recovery", "coverage") for kind in ("png", "svg")
    }
    assert "In short" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("missing", ["rows", "options", "metrics", "table"])
def test_whatever_is_missing_costs_only_its_own_place(missing):
    said = text(fake(**{missing: None}), PAGE)
    assert "In short" in said and "None" not in said
    assert ("There is no figure here" in said) == (missing == "rows")


@pytest.mark.parametrize("key", sorted(row("a", "named")))
def test_a_row_may_lack_anything(key):
    for blank in ({}, {key: None}):
        some = [{k: v for k, v in {**r, **blank}.items() if blank or k != key} for r in rows()]
        said = text(fake(some))
        assert "None" not in said and "What could not be shown" not in said
        assert {"confusion", "recovery"} <= set(PAGE.figures(fake(some)))


def test_nothing_at_all_is_still_a_page():
    assert "There is no verdict in this answer." in text({}, PAGE)
    assert list(PAGE.figures({})) == ["nothing"]


@pytest.mark.parametrize("junk", [float("nan"), float("inf"), "x", [], {}, 3])
@pytest.mark.filterwarnings("error")
def test_odd_values_are_survived(junk):
    odd = {k: junk for k in ("p_value", "seed", "missing", "ranking", "fault", "errors", "runs")}
    odd_table = {
        "hidden": "a",
        "answers": junk,
        "logs": junk,
        "named_first": junk,
        "worst_relative_error": junk,
    }
    answer = fake([*rows(), row("cg_offset", "named") | odd], table=[odd_table, junk])
    assert list(PAGE.figures(answer)) == ["confusion", "recovery", "coverage"]
    found = text(answer)
    assert "What could not be shown" not in found and not re.search(r"\bnan\b|\bNone\b", found)


@pytest.mark.filterwarnings("error")
def test_hostile_names_stay_text():
    def hostile(value: Any) -> Any:
        if isinstance(value, str):
            return value if value in ("named", "nothing") else HOSTILE
        if isinstance(value, dict):
            return {k: hostile(v) for k, v in value.items()}
        return [hostile(v) for v in value] if isinstance(value, list) else value

    answer = fake(hostile(rows()), table=hostile(fake().table), metrics={HOSTILE: HOSTILE})
    page = PAGE.page(answer)
    page.encode("utf-8")
    assert "\x1b" not in page and "\u202e" not in page
    found = PageText(page)
    assert found.faults == [] and dangers(found) == [] and broken_references(found) == []
    assert "<script>alert('x')</script>\\x1b[31m" in found.text
