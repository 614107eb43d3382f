"""Every page: that it is inert and complete in itself, and that it survives what it is given."""

import gc
import json
import re
import time

import numpy as np
import pytest

from auvnn.answers import DRAWERS
from auvnn.report import page as page_module
from auvnn.report import style
from auvnn.report.html import SECURITY, breakable
from auvnn.report.page import Page
from tests.report.fake_signals import HOSTILE, Fake
from tests.report.html_reading import PageText, broken_references, dangers
from tests.report.report_fakes import KINDS, comparison, demo, diagnosis, drawer, make, training


@pytest.fixture(scope="module", autouse=True)
def layout():
    """Leave the parts of figures where they are: these tests ask about pages."""


ELEMENTS = {
    "html", "head", "meta", "title", "style", "body", "main", "header", "h1", "h2", "h3", "p", "section", "nav",
    "ul", "ol", "li", "a", "figure", "figcaption", "b", "div", "img", "details", "summary", "table", "thead",
    "tbody", "tr", "th", "td", "dl", "dt", "dd", "footer", "svg", "g", "defs", "path", "use", "clippath", "rect",
    "image", "pattern", "wbr",
}  # fmt: skip


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


def test_a_long_name_in_a_table_may_be_broken_after_its_signs_and_nowhere_else():
    assert breakable("velocity_misalignment") == "velocity_<wbr>misalignment"
    assert breakable("ocean_current") == "ocean_current", "a short name stays whole"
    assert (
        breakable("<b>_long_hostile_name</b>") == "&lt;b&gt;_<wbr>long_<wbr>hostile_<wbr>name&lt;/<wbr>b&gt;"
    )
    assert breakable("1.234 ± 0.005 m/s over all dives") == "1.234 ± 0.005 m/s over all dives"
