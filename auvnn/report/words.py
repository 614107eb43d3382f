"""Numbers and names as text for a reader: rounded, with units, and harmless whatever a log called itself."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

MINUS = "\N{MINUS SIGN}"
_DIGITS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Invisible to str.isprintable, yet ours: they only keep numbers and units together.
_SPACES = "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}"


def visible(text: Any, limit: int = 2000) -> str:
    r"""Return the text with everything invisible written out, so that no name can hide what it is.

    Control and format characters (bidirectional overrides too), private and lone surrogate code points
    become `\x1b` or `\u202e`; line ends and tabs become spaces; beyond `limit` characters it is cut.
    """
    text = str(text)
    if len(text) > limit:
        text = text[: limit - 1] + "…"
    if text.isprintable():
        return text
    return "".join(_one(c) for c in text)


def _one(c: str) -> str:
    if c.isprintable() or c in _SPACES:
        return c
    if c in "\n\r\t" or c.isspace():
        return " "
    code = ord(c)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


_PROSE = (
    (re.compile(r"(?<=\s)\+-(?=\s)"), "±"),
    (re.compile(r"(?<=\s)->(?=\s)"), "→"),
    (re.compile(r"(?<=\d) ?%(?!\w)"), f"{_SPACES[0]}%"),
    (
        re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?)e([+-]\d+)(?!\w|\.\w)"),
        lambda m: f"{m[1]} × 10{str(int(m[2])).translate(_DIGITS)}",
    ),
)


def prose(text: str) -> str:
    """Return a sentence of an answer, which is plain ASCII, with the signs of a page: ±, →, 10⁻⁷, a space before %."""
    for pattern, sign in _PROSE:
        text = pattern.sub(sign, text)
    return text


def finite(value: Any) -> float | None:
    """Return the value as a finite float, or None for everything that is not one."""
    if value is None or isinstance(value, (bool, str, dict, list, tuple)):
        return None
    try:
        value = float(value)
    except (TypeError, ValueError):
        return None
    return value if math.isfinite(value) else None


def number(value: Any, digits: int = 3, unknown: str = "–") -> str:
    """Return a number with so many significant digits: `0.0123`, `4.56 × 10⁻⁷`, or `–` where unknown.

    Args:
        value: any number, or None.
        digits: significant ones.
        unknown: what stands where it is no finite number.
    """
    value = finite(value)
    if value is None:
        return unknown
    if value == 0:
        return "0"
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    # Of the rounded number: 9.999 has become 10.0.
    exponent = int(power)
    if -4 <= exponent < max(6, digits):
        return f"{value:.{max(0, digits - 1 - exponent)}f}".replace("-", MINUS)
    return f"{mantissa} × 10{str(int(power)).translate(_DIGITS)}".replace("-", MINUS)


def count(value: Any, unknown: str = "–") -> str:
    """Return a whole number with thousands set apart: `1 000 000`."""
    value = finite(value)
    return unknown if value is None else f"{round(value):,}".replace(",", _SPACES[1]).replace("-", MINUS)


def percent(share: Any) -> str:
    """Return a share of one as a percentage: `37 %`, `0.2 %`, `99.9 %`; all and nothing only where exact."""
    share = finite(share)
    if share is None:
        return "–"
    value = 100 * share
    if 99 < value < 100:
        text = f"{min(value, 99.9):.1f}"
    elif value != 0 and abs(value) < 1:
        text = number(value, 1)
    else:
        text = f"{value:.0f}".replace("-", MINUS)
    return f"{text}{_SPACES[0]}%"


def interval(value: Any, std: Any, unit: str = "") -> str:
    """Return `0.203 ± 0.004 m/s`: value and one standard deviation, both to two digits of the latter.

    Args:
        value: any number, or None.
        std: one standard deviation, or None.
        unit: of both; "1" and "-" are left out.
    """
    value, std = finite(value), finite(std)
    unit = f"{_SPACES[0]}{unit}" if unit and unit not in ("1", "-") else ""
    if value is None:
        return "–"
    if std is None or std <= 0:
        return f"{number(value)}{unit}"
    exponent = math.floor(math.log10(std))
    if not -5 <= exponent < 5 or abs(value) >= 1e7:
        return f"{number(value)} ± {number(std, 2)}{unit}"
    decimals = max(0, 1 - exponent)
    return f"{value:.{decimals}f} ± {std:.{decimals}f}{unit}".replace("-", MINUS)


def p_value(p: Any) -> str:
    """Return a p-value as people write it: `0.03`, `3 × 10⁻⁹`, `< 10⁻³⁰⁰`."""
    p = finite(p)
    if p is None:
        return "–"
    if p < 1e-300:
        return "< 10⁻³⁰⁰"
    if p >= 1e-3:
        return f"{p:.3f}" if p < 0.01 else f"{p:.2f}"
    mantissa, power = f"{p:.0e}".split("e")
    return f"{mantissa} × 10{str(int(power)).translate(_DIGITS)}"


def listing(items: Iterable[Any], last: str = "and") -> str:
    """Return `a, b and c`."""
    items = [str(i) for i in items]
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} {last} {items[-1]}" if items else ""


def plural(n: Any, one: str, many: str | None = None) -> str:
    """Return `1 run`, `3 runs`, `1 000 000 samples`.

    Args:
        n: how many.
        one: the word for one.
        many: the word for several; with an s by default.
    """
    value = finite(n)
    return f"{count(n, 'an unknown number of')} {one if value == 1 else many or one + 's'}"


def label(text: Any, limit: int = 34) -> str:
    """Return a foreign name fit for a figure: visible, short, and never read as mathematics.

    Matplotlib takes `$...$` for mathematics, in which most text is a syntax error, and leaves out of the
    legend what begins with an underscore.
    """
    text = visible(text)
    text = (text if len(text) <= limit else f"{text[: limit - 1]}…").replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text
