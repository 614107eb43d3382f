"""The page of the benchmark and its three plots: what they count, and that they survive what they are given."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.container import ErrorbarContainer
from matplotlib.patches import Rectangle
from scipy import stats

from auvnn.answers import DRAWERS
from auvnn.report import style
from auvnn.report.html import SECURITY
from auvnn.report.pages.benchmark import PAGE, BenchmarkPage
from auvnn.report.pages.sections.benchmark_words import TARGET
from auvnn.report.panels import NoData
from auvnn.report.plots.confusion import OUTCOMES, confusion
from auvnn.report.plots.coverage import coverage
from auvnn.report.plots.recovery import ALL, recovery, sizes_of, wilson
from auvnn.report.view import View
from tests.report.html_reading import PageText, broken_references, dangers
from tests.report.report_fakes import HOSTILE

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
        "Most often missed is thruster_lag, 4 of 10: the answer was ocean_current (2) and adequate (1)."
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
    lines = re.findall(r"<tr><th scope=\"row\">(.*?)</th><td>(.*?)</td>", listed)
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


# The plots.


COUNTS = np.array([[8, 1, 0, 2, 0, 1, 0], [0, 0, 0, 3, 0, 0, 0], [0, 1, 0, 0, 0, 9, 0]])
HIDDEN = ["ocean_current", "cg_offset", "nothing"]
ANSWERED = ["ocean_current", "cg_offset", "tether", *OUTCOMES]


def cells(ax: Any) -> dict[tuple[float, float], str]:
    return {t.get_position(): t.get_text() for t in ax.texts}


def test_the_confusion_shows_every_count_where_it_belongs():
    ax = confusion(HIDDEN, ANSWERED, COUNTS).axes[0]
    x = dict(zip((t.get_text() for t in ax.get_xticklabels()), ax.get_xticks(), strict=True))
    y = dict(zip((t.get_text() for t in ax.get_yticklabels()), ax.get_yticks(), strict=True))
    assert list(y) == HIDDEN and list(x) == ANSWERED
    shown = cells(ax)
    for i, hidden in enumerate(HIDDEN):
        for j, answered in enumerate(ANSWERED):
            wanted = answered == {"nothing": "adequate"}.get(hidden, hidden)
            expected = str(COUNTS[i, j]) if COUNTS[i, j] or wanted else None
            assert shown.get((x[answered], y[hidden])) == expected, (hidden, answered)
    totals = [t for (a, _), t in shown.items() if a > max(x.values()) + 0.5]
    assert totals == ["12", "3", "10", "logs"]


def test_the_right_answers_are_framed_and_the_others_bold():
    ax = confusion(HIDDEN, ANSWERED, COUNTS).axes[0]
    frames = [p for p in ax.patches if isinstance(p, Rectangle) and not p.get_fill()]
    middle = [(p.get_x() + p.get_width() / 2, p.get_y() + p.get_height() / 2) for p in frames]
    x = dict(zip(ANSWERED, ax.get_xticks(), strict=True))
    y = dict(zip(HIDDEN, ax.get_yticks(), strict=True))
    wanted = [("ocean_current", "ocean_current"), ("cg_offset", "cg_offset"), ("adequate", "nothing")]
    np.testing.assert_allclose(middle, [(x[a], y[h]) for a, h in wanted])
    bold = {t.get_position() for t in ax.texts if t.get_weight() == "bold"}
    assert bold == {(x[a], y[h]) for h, a in [("ocean_current", "cg_offset"), ("ocean_current", "ambiguous"),
                    ("ocean_current", "adequate"), ("cg_offset", "ambiguous"), ("nothing", "cg_offset")]}  # fmt: skip


def test_the_confusion_reads_in_grey():
    shares = np.diag(np.arange(1.0, 11)) + np.diag(np.arange(9.0, -1, -1), 1)[:10, :10]
    names = [f"e{i}" for i in range(10)]
    ax = confusion(names, names, shares).axes[0]
    faces = {(p.get_x() + 0.5, p.get_y() + 0.5): np.dot(to_rgb(p.get_facecolor()), (0.299, 0.587, 0.114))
             for p in ax.patches if p.get_fill()}  # fmt: skip
    x, y = ax.get_xticks(), ax.get_yticks()
    # Of ten logs each, ever more are right: ever darker.
    assert (np.diff([faces[x[i], y[i]] for i in range(9)]) < 0).all()
    for t in ax.texts:
        if t.get_position() in faces:
            ink = np.dot(to_rgb(t.get_color()), (0.299, 0.587, 0.114))
            assert abs(ink - faces[t.get_position()]) > 0.4


def test_the_outcomes_stand_apart_on_the_right_wherever_they_were():
    ax = confusion(["a", "b"], ["adequate", "a", "b"], [[1, 2, 0], [0, 0, 3]]).axes[0]
    assert [t.get_text() for t in ax.get_xticklabels()] == ["a", "b", "adequate"]
    gaps = np.diff(ax.get_xticks())
    assert gaps[0] == 1 and gaps[1] > 1.2


@pytest.mark.parametrize("k, n", [(0, 5), (5, 5), (3, 5), (90, 100), (1, 1), (199, 200)])
def test_intervals_are_wilsons(k, n):
    low, high = stats.binomtest(k, n).proportion_ci(method="wilson")
    assert wilson(k, n) == pytest.approx((low, high), abs=1e-12)
    assert wilson(0, 0) == (0.0, 1.0)


def test_recovery_shows_shares_intervals_and_all_effects_together():
    found = {"a": {"medium": (3, 5), "large": (5, 5)}, "b": {"medium": (0, 5), "large": (9, 10)}}
    figure = recovery(found, target=0.9)
    ax = figure.axes[0]
    assert [t.get_text() for t in ax.get_yticklabels()] == [ALL, "a", "b"]
    expected = [(3, 10), (14, 15), (3, 5), (5, 5), (0, 5), (9, 10)]
    drawn = [c for c in ax.containers if isinstance(c, ErrorbarContainer)]
    for bar, (k, n) in zip(drawn, expected, strict=True):
        assert bar.lines[0].get_xdata()[0] == pytest.approx(100 * k / n)
        ends = bar.lines[2][0].get_segments()[0][:, 0]
        low, high = stats.binomtest(k, n).proportion_ci(method="wilson")
        np.testing.assert_allclose(ends, [100 * low, 100 * high], atol=1e-9)
    rows_of = [bar.lines[0].get_ydata()[0] for bar in drawn]
    assert [round(y) for y in rows_of] == [0, 0, 1, 1, 2, 2] and len(set(rows_of)) == 6
    markers = [bar.lines[0].get_marker() for bar in drawn]
    assert markers[::2] == [markers[0]] * 3 and markers[1::2] == [markers[1]] * 3 and markers[0] != markers[1]
    assert [t.get_text() for t in ax.texts] == [f"{k} of {n}" for k, n in expected]
    words = [t.get_text() for t in figure.legends[0].get_texts()]
    assert words == ["medium", "large", "target: 90 % of all"]
    line = [li for li in ax.lines if list(li.get_xdata()) == [90.0, 90.0]]
    assert len(line) == 1 and line[0].get_linestyle() != "-"
    assert TARGET == 0.9


def test_one_effect_needs_no_sum_and_no_target():
    figure = recovery({"a": {"small": (1, 2)}})
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["a"]
    assert len(figure.legends[0].get_texts()) == 1


def test_sizes_go_from_small_to_large():
    assert sizes_of({"a": {"huge": 1, "large": 1}, "b": {"small": 1, "medium": 1}}) == [
        "small", "medium", "large", "huge"
    ]  # fmt: skip


def test_coverage_compares_with_the_standard_normal():
    z = stats.norm.ppf((np.arange(200) + 0.5) / 200)
    left, right_ax = coverage(np.random.default_rng(0).permutation(z).reshape(20, 10)).axes
    assert "190 of 200 within ±1.96: 95 %" in left.get_title("left")
    curve = next(li for li in left.lines if len(li.get_xdata()) > 100)
    np.testing.assert_allclose(curve.get_ydata(), stats.norm.pdf(curve.get_xdata()))
    bars = [p for p in left.patches if p.get_height() < 1]
    assert sum(p.get_height() * p.get_width() for p in bars) == pytest.approx(1.0)
    points = next(li for li in right_ax.lines if li.get_marker() == "s")
    np.testing.assert_allclose(points.get_xdata(), points.get_ydata())
    band = right_ax.collections[0].get_paths()[0].vertices
    rank = 150
    inside = band[np.isclose(band[:, 0], z[rank - 1], atol=1e-9), 1]
    expected = stats.norm.ppf(stats.beta(rank, 201 - rank).ppf([0.025, 0.975]))
    np.testing.assert_allclose(sorted(set(inside.round(9))), expected, atol=1e-8)


def test_too_small_standard_errors_are_steeper():
    z = 3 * stats.norm.ppf((np.arange(100) + 0.5) / 100)
    points = next(li for li in coverage(z).axes[1].lines if li.get_marker() == "s")
    slope = np.polyfit(points.get_xdata(), points.get_ydata(), 1)[0]
    assert slope == pytest.approx(3.0, rel=0.01)


def test_what_lies_far_out_is_drawn_at_the_edge_and_counted():
    left, right_ax = coverage([*np.linspace(-1, 1, 20), 1e9, -500.0, np.nan, np.inf]).axes
    assert "20 of 22" in left.get_title("left")
    assert any(t.get_text().startswith("2 beyond") for t in left.texts)
    top, bottom = right_ax.get_ylim()[1], right_ax.get_ylim()[0]
    marks = {li.get_marker(): list(li.get_ydata()) for li in right_ax.lines if li.get_marker() in "^v"}
    assert marks == {"^": [top], "v": [bottom]} and top < 10


@pytest.mark.parametrize(
    "draw",
    [
        lambda: confusion([], OUTCOMES, np.zeros((0, 4))),
        lambda: confusion(["a"], ["a"], [[0]]),
        lambda: confusion(["a"], ["a", "b"], [[1]]),
        lambda: confusion([f"e{i}" for i in range(99)], ["a"], np.ones((99, 1))),
        lambda: recovery({}),
        lambda: recovery({"a": {"small": (0, 0)}}),
        lambda: coverage([0.1, np.nan, 0.2, 0.3, 0.4]),
    ],
)
def test_without_data_a_plot_says_so(draw):
    with pytest.raises(NoData) as reason:
        draw()
    assert str(reason.value)


MANY = [f"effect_number_{i}" for i in range(26)]
DRAWN = {
    "confusion": lambda: confusion(HIDDEN, ANSWERED, COUNTS),
    "large confusion": lambda: confusion(MANY, [*MANY, *OUTCOMES], np.full((26, 30), 123)),
    "one cell": lambda: confusion(["nothing"], ["adequate"], [[200]]),
    "unknown counts": lambda: confusion(["a", "b"], ["a", "b"], [[np.nan, 1], [np.nan, np.nan]]),
    "hostile": lambda: confusion([HOSTILE], [HOSTILE], [[1]]),
    "recovery": lambda: recovery({"a": {"small": (1, 2)}, "b": {"odd": (0, 3)}}, target=0.9),
    "long recovery": lambda: recovery({n: {s: (9, 10) for s in ("small", "medium", "large")} for n in MANY}),
    "hostile recovery": lambda: recovery({HOSTILE: {HOSTILE: (1, 2)}}),
    "coverage": lambda: coverage(np.random.default_rng(0).standard_normal(40)),
    "equal errors": lambda: coverage(np.zeros(9)),
    "many errors": lambda: coverage(np.random.default_rng(0).standard_normal(5000)),
}  # fmt: skip


@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.filterwarnings("error")
def test_every_plot_fits_a_page(name):
    figure = DRAWN[name]()
    drawing = style.svg(figure)
    assert figure.get_figwidth() <= style.PAGE + 1e-9 and figure.get_figheight() < 12
    assert "\x1b" not in drawing
    for ax in figure.axes:
        assert ax.get_xlabel() and (ax.get_ylabel() or ax.get_yticklabels())
        # What constrained layout cannot fit it shrinks to nothing.
        assert ax.get_position().width > 0.25 and ax.get_position().height > 0.25


@pytest.mark.parametrize("name", ["confusion", "recovery", "coverage"])
def test_equal_data_give_equal_files(name):
    assert style.svg(DRAWN[name]()) == style.svg(DRAWN[name]())
