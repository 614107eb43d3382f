import numpy as np
import pytest

from auvnn.report import style
from auvnn.report.html import VECTOR_POINTS, figure_markup, sanitize_svg
from auvnn.report.plots.measured_against_model import measured_against_model
from auvnn.report.plots.ranking import ranking
from auvnn.report.plots.timeline import timeline
from tests.report.fake_signals import motion, times
from tests.report.html_reading import PageText, broken_references, dangers

EVIL = """<?xml version="1.0"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">
<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 9 9"
onload="x()">
<!-- <script>alert(1)</script> -->
<script>alert(1)</script><style>@import url(http://evil/x.css); body {display: none}</style>
<foreignObject><body xmlns="http://www.w3.org/1999/xhtml" onload="x()"><script>alert(2)</script></body>
</foreignObject>
<a xlink:href="javascript:alert(3)"><path id="inside" d="M0 0"/></a>
<image xlink:href="http://evil/x.png"/><image xlink:href="data:image/svg+xml;base64,AAAA"/>
<image xlink:href="data:image/png;base64,AAAA"/>
<use xlink:href="#kept"/><use xlink:href="http://evil/x.svg#a"/>
<path id="kept" d="M1.123456 2.987654L3 4" onclick="x()" style="fill: url(http://evil)"
clip-path="url(#clip)"/>
<path style="fill: url(#clip); stroke: #fff" d="M0 0"/>
<path style="background: URL( 'http://evil')" d="M0 0"/>
<defs><clipPath id="clip"><rect width="9" height="9"/></clipPath></defs>
<animate attributeName="href" to="javascript:alert(4)"/><set attributeName="onload" to="x()"/>
<text>a &lt;script&gt; b</text>
</svg>"""


def test_only_drawing_survives():
    page = PageText(sanitize_svg(EVIL, "f1"))
    assert dangers(page) == []
    assert broken_references(page) == []
    assert page.faults == []
    assert {a["id"] for _, a in page.tags if "id" in a} == {"f1-kept", "f1-clip"}
    assert [a.get("href") for a in page.named("image")] == [None, None, "data:image/png;base64,AAAA"]
    assert [a.get("href") for a in page.named("use")] == ["#f1-kept", None]
    assert page.text.strip() == "a <script> b"
    kept = next(a for _, a in page.tags if a.get("id") == "f1-kept")
    assert kept == {"id": "f1-kept", "d": "M1.12 2.98L3 4", "clip-path": "url(#f1-clip)"}


@pytest.mark.parametrize(
    "text", ['<!DOCTYPE x [<!ENTITY a "b">]><svg xmlns="http://www.w3.org/2000/svg"/>', "<html/>", "not xml"]
)
def test_what_is_no_plain_svg_is_refused(text):
    with pytest.raises((ValueError, SyntaxError)):
        sanitize_svg(text, "f")


def test_a_figure_goes_in_as_vectors_and_keeps_its_references():
    figure = ranking(
        [{"effect": "a<b>&\"'", "explained": 0.5, "cv_before": 1, "cv_after": 0.5}], ["a<b>&\"'"]
    )
    page = PageText(str(figure_markup(figure, "one", 'an <alt> "text"')))
    assert dangers(page) == [] and broken_references(page) == [] and page.faults == []
    assert page.named("img") == []
    assert page.named("div")[0]["aria-label"] == 'an <alt> "text"'
    # The hatch of the chosen bar is a pattern, referred to by id.
    assert page.named("pattern")


def test_two_figures_on_a_page_share_no_ids():
    figure = timeline([{"run": 1, "t": np.arange(90.0), "channels": {"u": np.ones(90)}}])
    both = str(figure_markup(figure, "one", "")) + str(figure_markup(figure, "two", ""))
    assert broken_references(PageText(both)) == []


def test_a_figure_of_very_many_points_goes_in_as_pixels():
    t = times(4000)
    figure = measured_against_model(t, motion(t), motion(t, 1), limit=4000)
    assert style.points(figure) > VECTOR_POINTS
    page = PageText(str(figure_markup(figure, "many", "a <b>")))
    (image,) = page.named("img")
    assert image["src"].startswith("data:image/png;base64,iVBORw0KGgo")
    assert image["alt"] == "a <b>"
    assert not page.named("svg")


def test_the_points_of_a_figure_are_counted():
    t = times(500)
    figure = measured_against_model(t, motion(t), motion(t, 1))
    assert style.points(figure) == 6 * 2 * 500
