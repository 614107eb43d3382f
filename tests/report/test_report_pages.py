"""Every page: what it says, that it is inert and complete in itself, and that it survives what it is "
"given."""

import gc
import importlib
import json
import re
import time

import numpy as np
import pytest
from filelock import FileLock
from html_reading import PageText, broken_references, dangers
from markupsafe import Markup
from report_fakes import (
    HOSTILE,
    KINDS,
    Fake,
    comparison,
    demo,
    diagnosis,
    improvement,
    make,
    quality,
    training,
)

from auvnn.answers import DRAWERS
from auvnn.report import page as page_module
from auvnn.report import style
from auvnn.report.html import SECURITY
from auvnn.report.page import Page

# As it is for users; while a test of this file runs, figures are not laid out (tests/conftest.py).
LAID_OUT = style.settle
ELEMENTS = {
    *(
        "html",
        "head",
        "meta",
        "title",
        "style",
        "body",
        "main",
        "header",
        "h1",
        "h2",
        "h3",
        "p",
        "section",
        "nav",
    ),
    *(
        "ul",
        "ol",
        "li",
        "a",
        "figure",
        "figcaption",
        "b",
        "div",
        "img",
        "details",
        "summary",
        "table",
        "thead",
    ),
    *("tbody", "tr", "th", "td", "dl", "dt", "dd", "footer"),
    *("svg", "g", "defs", "path", "use", "clippath", "rect", "image", "pattern"),
}


@pytest.fixture
def unseen(monkeypatch):
    """Make figures, but do not render them."""
    monkeypatch.setattr("auvnn.report.page.figure_markup", lambda *_: Markup('<div class="plot"></div>'))
    monkeypatch.setattr(style, "settle", lambda figure: figure)


def drawer(kind: str) -> Page:
    return importlib.import_module(f"auvnn.report.pages.{kind}").PAGE


@pytest.fixture(scope="session")
def pages(tmp_path_factory, worker_id) -> dict[str, str]:
    """Return all pages, their figures laid out; whichever worker needs them first draws them for all."""

    def drawn():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(style, "settle", LAID_OUT)
            return {kind: drawer(kind).page(make(kind, 1200, 1)) for kind in KINDS}

    if worker_id == "master":
        return drawn()
    place = tmp_path_factory.getbasetemp().parent / "pages.json"
    with FileLock(f"{place}.lock"):
        if not place.exists():
            place.write_text(json.dumps(drawn()), encoding="utf-8")
    return json.loads(place.read_text(encoding="utf-8"))


@pytest.mark.parametrize("kind", KINDS)
def test_answers_find_their_page_by_name(kind):
    assert DRAWERS.get(kind) is drawer(kind)
    assert isinstance(DRAWERS.get(kind), Page) and DRAWERS.get(kind).kind == kind


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_complete_inert_and_sound(pages, kind):
    page = PageText(pages[kind])
    assert dangers(page) == []
    assert broken_references(page) == []
    assert page.faults == []
    assert {tag for tag, _ in page.tags} <= ELEMENTS
    policy = [m["content"] for m in page.named("meta") if m.get("http-equiv") == "Content-Security-Policy"]
    assert policy == [SECURITY]
    assert "default-src 'none'; img-src data:; style-src 'unsafe-inline'" in policy[0]
    assert page.named("html")[0]["lang"] == "en"
    assert len(page.named("h1")) == 1
    assert "There is no figure here" not in page.text
    assert "What could not be shown" not in page.text
    assert "nan" not in page.text.lower().split() and "None" not in page.text


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_begins_with_three_to_six_sentences_in_plain_words(pages, kind):
    box = re.search(r'<section class="short".*?</section>', pages[kind], re.S).group()
    sentences = re.findall(r"<p>(.*?)</p>", box, re.S)
    assert 3 <= len(sentences) <= 6
    assert all(s.endswith((".", ":")) for s in sentences)
    assert pages[kind].index('class="short"') < pages[kind].index("<figure")


@pytest.mark.parametrize("kind", KINDS)
def test_figures_come_before_tables_and_say_what_to_see(pages, kind):
    captions = re.findall(r"<figcaption><b>(.*?)</b> (.*?)</figcaption>", pages[kind], re.S)
    assert len(captions) >= 2
    assert all(len(text) > 40 and text.rstrip().endswith(".") for _, text in captions)
    if kind != "demo":
        assert pages[kind].rindex("</figure>") < pages[kind].index("<table")
        assert pages[kind].rindex("</table>") < pages[kind].index("What was read and assumed")


@pytest.mark.parametrize("kind", KINDS)
def test_pages_are_light(pages, kind):
    assert len(pages[kind].encode()) < (6_000_000 if kind == "demo" else 2_500_000)


@pytest.mark.parametrize("kind", KINDS)
def test_pages_stand_on_screens_of_any_size_in_the_dark_and_on_paper(pages, kind):
    page = PageText(pages[kind])
    assert any(m.get("name") == "viewport" for m in page.named("meta"))
    for query in ("prefers-color-scheme: dark", "@media print", "max-width"):
        assert query in page.styles[0]
    pictures = [*page.named("img"), *[d for d in page.named("div") if d.get("role") == "img"]]
    assert pictures and all(p.get("alt") or p.get("aria-label") for p in pictures)


def test_comparison_says_how_far_off_and_where(unseen):
    text = PageText(drawer("comparison").page(comparison(60))).text
    assert "Running free for 5 s, the model's error is 26 % of the spread" in text
    assert "would give 95 %" in text and "The model predicts." in text
    assert "sway (Y): heading -1.6 to 0 rad (42 % of the error)" in text
    assert "diverged in 1 window" in text
    assert "stands out most in roll (K): 9.00 N m rms, 30 times the noise floor" in text
    assert "bandwidth 1.70 Hz" in text


@pytest.mark.parametrize(("held", "words"), [(0.1, "worse than none"), (0.26, "no better than none")])
def test_comparison_does_not_flatter(unseen, held, words):
    answer = comparison(60)
    answer.rollout["5"]["persistence"] = held
    assert words in PageText(drawer("comparison").page(answer)).text


def test_the_map_names_its_largest_cell(unseen):
    answer = comparison(60)
    answer.regimes["speed"]["rms"][3, 1] = 300.0
    text = PageText(drawer("comparison").page(answer)).text
    assert "The largest: K at speed 0.20 to 0.40 m/s, 1000 times the noise floor." in text


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        (
            "named",
            ["The model lacks ocean_current.", "v_north 0.2031 ± 0.0042", "hard to tell from constant_force"],
        ),
        ("ambiguous", ["cannot tell which: ocean_current or constant_force"]),
        ("unknown", ["nothing in the catalogue explains", "What remains depends most on u"]),
        (
            "adequate",
            ["Nothing is missing that this log could show", "10 effects of the catalogue were tried"],
        ),
    ],
)
def test_diagnosis_says_its_verdict(unseen, verdict, words):
    page = PageText(drawer("diagnosis").page(diagnosis(verdict)))
    for part in words:
        assert part in page.text
    assert "not judged: needs altitude" in page.text


@pytest.mark.parametrize(("accepted", "words"), [(True, ": accepted."), (False, ": not accepted.")])
def test_improvement_says_whether_it_was_accepted(unseen, accepted, words):
    page = PageText(drawer("improvement").page(improvement(60, accepted=accepted)))
    assert words in page.text
    assert (
        "0.26 of the spread of the motion, 0.21 with its coefficients fitted again, and 0.052 with"
        in page.text
    )
    assert "95 % of what could be gained" in page.text


def test_quality_says_what_is_wrong_and_how_to_mend_it(unseen):
    page = PageText(drawer("quality").page(quality(60)))
    assert "p has the opposite sign of the attitude's derivative (scale: -1 in the mapping)" in page.text
    assert "the sign of roll (p) and pitch (q) is reversed" in page.text
    assert "Too little moves in roll (p)" in page.text
    error = {"level": "error", "where": "time", "what": "median step 20 s", "cure": "time: {unit: ms}"}
    page = PageText(drawer("quality").page(quality(60, findings=[error])))
    assert (
        "Nothing should be fitted to this log as it is: time: median step 20 s (time: {unit: ms})."
        in page.text
    )


def test_training_says_where_it_was_best(unseen):
    text = PageText(drawer("training").page(training())).text
    assert "from 0.870 to 0.100" in text and "is step 127" in text
    assert "396" in text and "396.0" not in text


def test_training_takes_damping_in_every_form():
    from auvnn.report.pages.training import curves

    nu = np.linspace(-1, 1, 5)
    listed = curves([{"velocity": nu, "force": 2 * nu}] * 6)
    named = curves({c: {"nu": nu, "learned": 2 * nu} for c in "uvwpqr"})
    by_axis = curves({a: {"nu": nu, "d": 2 * nu} for a in "XYZKMN"})
    tabled = curves(
        {
            "nu": np.tile(nu, (6, 1)),
            "learned": np.tile(2 * nu, (6, 1)),
            "covered": np.tile([-0.5, 0.5], (6, 1)),
        }
    )
    paired = curves([(nu, 2 * nu)] * 6)
    for found in (listed, named, by_axis, tabled, paired):
        assert len(found) == 6
        for curve in found:
            np.testing.assert_array_equal(curve["nu"], nu)
            np.testing.assert_array_equal(curve["learned"], 2 * nu)


def test_demo_tells_the_whole_story_once(pages):
    page = PageText(pages["demo"])
    assert [a["href"] for a in page.named("a")] == ["#quality", "#comparison", "#diagnosis", "#improvement"]
    for line in ("error over 5 s before: 0.26", "missing: ocean_current"):
        assert line in page.text
    assert "What had been hidden: v_north 0.200 (found 0.2031" in page.text
    assert page.text.count("Before and after, on a held-out run.") == 1
    assert page.text.count("The candidates, best first.") == 1


@pytest.mark.parametrize("missing", ["quality", "comparison", "diagnosis", "improvement", "truth", "story"])
def test_demo_goes_on_without_any_of_its_parts(unseen, missing):
    page = PageText(drawer("demo").page(demo(60, **{missing: None})))
    assert page.faults == [] and "In short" in page.text
    assert f"#{missing}" not in [a["href"] for a in page.named("a")]


def hostile(value, keys=False):
    """Return the same answer with every text in it replaced."""
    if isinstance(value, str):
        return HOSTILE
    if isinstance(value, dict):
        return {(f"{k}{HOSTILE}" if keys else k): hostile(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(hostile(v) for v in value)
    if isinstance(value, Fake):
        for name, inner in vars(value).items():
            if name not in ("json", "log") or isinstance(inner, str):
                setattr(
                    value,
                    name,
                    hostile(inner, keys=name in ("parameters", "regimes", "channels", "depends_on")),
                )
    return value


@pytest.mark.parametrize("kind", KINDS)
def test_names_from_a_log_stay_text(kind, request):
    if kind == "demo":
        # Its figures are those of its parts, which are drawn with such names one by one.
        request.getfixturevalue("unseen")
    answer = hostile(make(kind))
    html = drawer(kind).page(answer)
    html.encode("utf-8")
    assert "\x1b" not in html and "\u202e" not in html and "\ud800" not in html
    page = PageText(html)
    assert dangers(page) == [] and broken_references(page) == [] and page.faults == []
    assert {tag for tag, _ in page.tags} <= ELEMENTS
    assert "onerror" not in {name for _, attributes in page.tags for name in attributes}
    assert "<script>alert('x')</script>\\x1b[31m\\u202e$\\frac{\\ud800" in page.text
    for name in drawer(kind).figures(answer):
        assert re.fullmatch(r"[a-z0-9_]{1,60}", name)


def everything_else(kind):
    return [name for name in vars(make(kind)) if name != "json"]


JUNK = (None, [], {}, 3, "text", float("nan"), object(), [None], {"a": None}, np.ones(2))


def assert_survives(kind, answer, case):
    read = PageText(drawer(kind).page(answer))
    assert read.faults == [] and "In short" in read.text, case
    assert dangers(read) == [], case


@pytest.mark.parametrize("kind", KINDS[:-1])
@pytest.mark.parametrize("junk", JUNK, ids=lambda value: type(value).__name__)
def test_an_answer_of_nothing_but_junk_still_gives_a_page(unseen, kind, junk):
    answer = make(kind, 60, 1)
    for name in everything_else(kind):
        setattr(answer, name, junk)
    assert_survives(kind, answer, junk)


@pytest.mark.parametrize("kind", KINDS[:-1])
def test_whatever_is_missing_costs_only_its_own_place(unseen, kind):
    for i, name in enumerate(everything_else(kind)):
        answer = make(kind, 60, 1)
        setattr(answer, name, JUNK[i % len(JUNK)])
        assert_survives(kind, answer, name)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS[:-1])
def test_whatever_is_missing_costs_only_its_own_place_whatever_stands_there(unseen, kind):
    for name in everything_else(kind):
        for junk in JUNK:
            answer = make(kind, 60, 1)
            setattr(answer, name, junk)
            assert_survives(kind, answer, (name, junk))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("answer", [{}, Fake(), object()])
def test_an_empty_answer_still_gives_a_page_and_a_figure(kind, answer):
    read = PageText(drawer(kind).page(answer))
    assert read.faults == [] and "In short" in read.text
    figures = drawer(kind).figures(answer)
    assert len(figures) >= 1
    assert len(style.svg(next(iter(figures.values())))) > 500


def test_a_missing_series_is_said_where_the_figure_would_be(unseen):
    page = PageText(drawer("comparison").page(comparison(60, series=[])))
    assert page.text.count("There is no figure here: the answer holds no time series.") == 3
    assert "Where the residual sits." in page.text


def blank(value):
    """Return the same answer with every number unknown."""
    if isinstance(value, (float, int)) and not isinstance(value, bool):
        return None
    if isinstance(value, np.ndarray):
        return np.full(value.shape, np.nan)
    if isinstance(value, dict):
        return {k: blank(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(blank(v) for v in value)
    if isinstance(value, Fake):
        for name, inner in vars(value).items():
            setattr(value, name, blank(inner) if name != "log" else inner)
    return value


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.filterwarnings("error")
def test_unknown_numbers_are_dashes(kind):
    answer = blank(make(kind))
    page = PageText(drawer(kind).page(answer))
    assert page.faults == []
    assert not re.search(r"\bnan\b|\bNone\b", page.text)


@pytest.mark.parametrize("kind", ["diagnosis", "training"])
def test_a_page_and_its_figures_are_written_and_equal_twice(tmp_path, kind):
    answer = make(kind, 60)
    for name in ("one", "two"):
        assert drawer(kind).write(answer, tmp_path / name) == tmp_path / name / "report.html"
    one, two = (
        {p.relative_to(tmp_path / n): p.read_bytes() for p in (tmp_path / n).rglob("*") if p.is_file()}
        for n in ("one", "two")
    )
    assert one == two
    kinds = {p.suffix for p in one}
    assert kinds == {".html", ".png", ".svg"}
    figures = {p.stem for p in one if p.suffix == ".png"}
    assert figures == {p.stem for p in one if p.suffix == ".svg"} and len(figures) >= 2
    assert figures == set(drawer(kind).figures(answer))


def test_a_report_of_several_answers_shows_again_what_was_drawn_of_each(tmp_path, monkeypatch):
    answer = demo(60, quality=None, comparison=None, improvement=None)
    drawer("diagnosis").write(answer.diagnosis, tmp_path / "diagnose")
    drawn = []
    monkeypatch.setattr(style, "svg", lambda figure, svg=style.svg: drawn.append(figure) or svg(figure))
    page = PageText(drawer("demo").page(answer))
    figures = [a["id"] for tag, a in page.tags if tag == "figure"]
    again = {f"diagnosis-{name}" for name in drawer("diagnosis").figures(answer.diagnosis)}
    assert again <= set(figures) and len(drawn) == len(figures) - len(again)
    # With the answer goes what was drawn of it.
    kept = (id(answer.diagnosis), "diagnosis")
    assert kept in page_module._kept
    del answer
    gc.collect()
    assert kept not in page_module._kept


def test_the_most_telling_figure_comes_first(pages):
    drawn = drawer("training").figures(make("training"))
    shown = re.findall(r'<figure id="(\w+)"', pages["training"])
    assert list(drawn) == shown, "the figures of an answer are those of its page, in the same order"
    first = {kind: re.search(r'<figure id="([\w-]+)"', pages[kind])[1] for kind in KINDS}
    assert first == {
        "quality": "timeline",
        "comparison": "measured_against_model",
        "diagnosis": "ranking",
        "improvement": "before_after",
        "training": "history",
        "demo": "before_after",
    }


def test_a_million_samples_are_drawn_within_ten_seconds():
    answer = comparison(1_000_000, runs=1)
    start = time.process_time()
    html = drawer("comparison").page(answer)
    assert time.process_time() - start < 10.0
    assert len(html) < 2_500_000
    assert "There is no figure here" not in html


def test_the_json_beside_the_page_is_the_answers_own(tmp_path):
    from auvnn.answers import Answer

    class Real(Answer):
        kind = "training"

        def to_dict(self):
            return training().to_dict()

    path = Real().write(tmp_path)
    assert json.loads(path.read_text())["schema"] == "auvnn/training/1"
    assert (tmp_path / "report.html").exists() and (tmp_path / "figures" / "history.svg").exists()
    assert Real().report(tmp_path / "other.html").read_text().startswith("<!doctype html>")
    assert Real().plot().axes[0].get_xlabel() == "step"


def test_a_figure_that_cannot_be_rendered_leaves_a_note(tmp_path, monkeypatch):
    real = style.svg

    def fails(figure):
        if len(figure.axes) == 2:  # the ranking
            raise RuntimeError("no such glyph")
        return real(figure)

    monkeypatch.setattr(style, "svg", fails)
    drawer("diagnosis").write(diagnosis(), tmp_path)
    page = PageText((tmp_path / "report.html").read_text())
    assert (
        page.text.count("There is no figure here: it could not be rendered (RuntimeError: no such glyph).")
        >= 1
    )
    assert not (tmp_path / "figures" / "ranking.png").exists()
    assert (tmp_path / "figures" / "parameters.png").exists()


class Network:
    """A model as an answer carries it: no name of its own, and a very long description."""

    def __str__(self):
        return "GreyBox(" + "Linear(), " * 500


@pytest.mark.parametrize("kind", ["improvement", "training"])
def test_an_answer_that_carries_its_model_is_called_by_the_models_name(unseen, kind):
    answer = make(kind, 60)
    json_answer = {**answer.to_dict(), "model": "rov95"}
    answer.model, answer.to_dict = Network(), lambda: json_answer
    text = PageText(drawer(kind).page(answer)).text
    assert "GreyBox(" not in text and "rov95" in text


def test_training_as_the_verb_answers_it(unseen):
    from auvnn.report.pages.training import curves

    nu = np.linspace(-1, 1, 5)
    found = curves([{"nu": nu, "learned": nu, "low": -0.5, "high": 0.25}] * 6)
    assert found[0]["covered"] == (-0.5, 0.25) and "low" not in found[0]
    answer = training(
        scheme={"scheme": "levenberg_marquardt", "max_iterations": 300},
        damping={"form": "mlp", "hidden": 5},
        history={
            "iteration": [1, 2, 3],
            "train": [3.0, 2.0, 1.0],
            "held_out": [3.0, 1.5, 2.0],
            "step": "iteration",
        },
        metrics={"held_out_r2_du_before": 0.1, "held_out_r2_du_after": 0.7, "iterations": 3},
        stopped="the held-out error rises",
    )
    text = PageText(drawer("training").page(answer)).text
    assert "The best of 3 iterations is iteration 2" in text
    assert "most is gained in surge (du): R² from 0.10 to 0.70" in text
    assert "levenberg_marquardt, max iterations 300" in text and "mlp, hidden 5" in text
    assert "It stopped because: the held-out error rises." in text
