"""The plots of the benchmark: what they show, and that they survive what they are given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.container import ErrorbarContainer
from matplotlib.patches import Rectangle
from scipy import stats

from auvnn.report import style
from auvnn.report.pages.sections.benchmark_words import TARGET
from auvnn.report.panels import NoData
from auvnn.report.plots.confusion import OUTCOMES, confusion
from auvnn.report.plots.coverage import coverage
from auvnn.report.plots.recovery import ALL, recovery, sizes_of, wilson
from tests.report.fake_signals import HOSTILE

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
    assert words == ["medium", "large", "target: 90\N{NO-BREAK SPACE}% of all"]
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
    assert sizes_of({"a": {"150%": 1, "15%": 1}, "b": {"40%": 1}}) == ["15%", "40%", "150%"]


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
    assert "; 2 beyond ±" in left.get_title("left")
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
