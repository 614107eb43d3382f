import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvnn.report import words

SUPERSCRIPT = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def read(text: str) -> float:
    """Read a number as `words.number` writes it."""
    text = text.replace("\N{MINUS SIGN}", "-")
    mantissa, _, power = text.partition(" × 10")
    return float(mantissa) * 10.0 ** int(power.translate(SUPERSCRIPT) or 0)


@given(st.floats(-1e12, 1e12).filter(lambda x: x == 0 or abs(x) > 1e-12))
def test_a_number_reads_back_to_three_digits(value):
    assert read(words.number(value)) == pytest.approx(value, rel=5.1e-3)
    assert len(words.number(value)) <= 14


@given(st.text())
def test_visible_text_is_printable_and_encodable(text):
    shown = words.visible(text)
    assert all(c.isprintable() or c in "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}" for c in shown)
    shown.encode("utf-8")
    assert len(words.visible(text, 40)) <= 40 * 10


def test_hidden_characters_are_written_out():
    assert words.visible("a\x1b[31m\u202eb\ud800\nc") == "a\\x1b[31m\\u202eb\\ud800 c"


@pytest.mark.parametrize("nothing", [None, math.nan, math.inf, "3", [], {}, True, object()])
def test_what_is_no_number_is_a_dash(nothing):
    assert words.number(nothing) == words.percent(nothing) == words.interval(nothing, 1.0) == "–"


def test_numbers_that_round_up_keep_their_digits():
    assert words.number(9.9999) == "10.0"
    assert words.number(0.00009999) == "0.000100"


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{NARROW NO-BREAK SPACE}", " ")


def test_interval_rounds_value_and_uncertainty_alike():
    assert plain(words.interval(0.20312, 0.00417, "m/s")) == "0.2031 ± 0.0042 m/s"
    assert plain(words.interval(-12.34, 3.3, "N")) == "\N{MINUS SIGN}12.3 ± 3.3 N"
    assert plain(words.interval(1.2, None, "1")) == "1.20"
    assert plain(words.interval(1234.5, 123.0, "N")) == "1234 ± 123 N"


def test_percent_says_all_and_nothing_only_where_exact():
    assert [plain(words.percent(x)) for x in (0, 1, 0.9996, 0.002, 0.374)] == [
        "0 %",
        "100 %",
        "99.9 %",
        "0.2 %",
        "37 %",
    ]


def test_p_values():
    assert [words.p_value(p) for p in (0.0, 3e-9, 0.0042, 0.3, None)] == [
        "< 10⁻³⁰⁰",
        "3 × 10⁻⁹",
        "0.004",
        "0.30",
        "–",
    ]


def test_lists_and_plurals():
    assert words.listing(["a", "b", "c"]) == "a, b and c"
    assert words.listing(["a", "b"], "or") == "a or b"
    assert words.listing([]) == ""
    assert plain(words.plural(1, "run")) == "1 run"
    assert plain(words.plural(1_000_000, "sample")) == "1 000 000 samples"
    assert words.plural(None, "sample") == "an unknown number of samples"


@given(st.text(min_size=1))
def test_a_label_is_never_mathematics_and_never_hidden_from_a_legend(text):
    from matplotlib.cbook import is_math_text

    label = words.label(text)
    assert not is_math_text(label)
    assert not label.startswith("_")
    assert not re.search(r"[\x00-\x1f\x7f]", label)
