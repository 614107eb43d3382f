"""The page of `check`: what a log holds, what is wrong with it, and what it can tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.pages.sections import quality_reading as reading
from auvnn.report.plots.excitation import excitation
from auvnn.report.plots.kinematics import kinematics
from auvnn.report.plots.timeline import timeline
from auvnn.report.view import View, name_of
from auvnn.report.words import count, finite, listing, number, percent, plural


class QualityPage(Page):
    """What a quality report says."""

    kind = "quality"

    def title(self, view: View) -> str:
        """Return the heading."""
        name = _name(view)
        return "Quality of the log" if name in ("", "log") else f"Quality of the log {name}"

    def about(self, view: View) -> str:
        """Return the files."""
        return listing(_read(view).get("files") or [])

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        found = reading.findings(view)
        levels = {level: [f for f in found if f.get("level") == level] for level in reading.LEVELS}
        errors, warnings = levels["error"], levels["warning"]
        if errors:
            out = [f"Nothing should be fitted to this log as it is: {_sentence(errors[0], cure=True)}."]
            if len(errors) > 1:
                out.append(f"Besides: {plural(len(errors) - 1, 'more error')}, listed below.")
        elif warnings:
            words = plural(len(warnings), "thing asks", "things ask")
            out = [f"The log can be used; {words} for care. First of all: {_sentence(warnings[0])}."]
        else:
            out = ["The log can be used as it is: nothing implausible was found."]
        metrics = _metrics(view)
        size = [plural(metrics[k], w) for k, w in (("samples", "sample"), ("runs", "run")) if k in metrics]
        if size:
            span = [
                f"{number(metrics['duration_s'])} s" if finite(metrics.get("duration_s")) else "",
                f"at {number(metrics['rate_hz'])} Hz" if finite(metrics.get("rate_hz")) else "",
            ]
            out.append(f"It holds {' in '.join(size)}{''.join(f', {s}' for s in span if s)}.")
        if finite(metrics.get("valid_share")) is not None:
            gaps = plural(metrics["gaps"], "gap") if finite(metrics.get("gaps")) else "no gap"
            out.append(f"{percent(metrics['valid_share'])} of the samples are complete, with {gaps} in time.")
        repairs = levels["repair"]
        if repairs:
            out.append(
                f"On reading, {plural(len(repairs), 'kind of fault was', 'kinds of fault were')} corrected and "
                "counted."
            )
        told = _actuator_words(view)
        if told and not _actuators(view).get("as_stated"):
            out[1:1] = told
            told = []
        return out + _agreement_words(view) + _excitation_words(view) + told

    def warnings(self, view: View) -> list[str]:
        """Return errors and warnings, each with its cure."""
        return [
            f"{str(f.get('level')).capitalize()}: {_sentence(f, cure=True)}."
            for f in reading.findings(view)
            if f.get("level") in ("error", "warning")
        ]

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        return [
            Plot(
                "timeline",
                "What the log holds, when",
                lambda: timeline(reading.tracks(view)),
                lambda: _timeline_caption(view),
            ),
            Plot(
                "kinematics",
                "Do the sensors agree",
                lambda: kinematics(reading.checks(view)),
                "Slope of each measured velocity on the one that follows from the attitude (p, q, r) or the "
                "position (u, v, w). Bars should end at the dashed line; a bar to the left is a reversed "
                "axis, one of another length a wrong unit. With a low correlation the slope means little.",
            ),
            Plot(
                "excitation",
                "What moves",
                lambda: excitation(reading.motion(view)),
                "Spread of each velocity in units of its sensor's noise. What does not reach the dashed "
                "line cannot be judged, and its coefficients cannot be found from this log.",
            ),
        ]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        return [
            HtmlTable(
                "Findings", ["level", "where", "what", "how to correct it"], _finding_rows(view), words=4
            ),
            HtmlTable(
                "Actuators, by what the vehicle does",
                ["in the model file", "acts as", "sign", "share of the stated thrust"],
                _actuator_rows(view),
                " ".join(f"{str(c)[:1].upper()}{str(c)[1:]}." for c in _actuators(view).get("cures") or []),
                words=3,
                folded=True,
            ),
            HtmlTable("Agreement of the sensors", _AGREEMENT_HEAD, _agreement_rows(view), words=2),
            HtmlTable("Runs", list(_RUN_HEAD), _run_rows(view)),
            HtmlTable("Channels", list(_CHANNEL_HEAD), _channel_rows(view), words=2),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        read = _read(view)
        return [
            ("Files", listing(read.get("files") or [])),
            ("SHA-256", str(read.get("sha256") or "")),
            ("Columns", ", ".join(map(str, read.get("columns") or []))),
            ("Kept, not used", ", ".join(map(str, read.get("unknown_columns") or []))),
            ("Actuation", str(read.get("actuation") or "")),
        ]


def _read(view: View) -> Mapping[str, Any]:
    return reading.plain_of(view, "read")


def _metrics(view: View) -> Mapping[str, Any]:
    return reading.plain_of(view, "metrics")


def _name(view: View) -> str:
    return name_of(view.data.get("log")) or name_of(view.get("log"))


_AGREEMENT_HEAD = ["channel", "verdict", "slope", "correlation", "late by (s)"]
_RUN_HEAD = ("run", "samples", "duration (s)", "rate (Hz)", "gaps", "longest step (s)", "complete")
_CHANNEL_HEAD = ("channel", "unit", "missing", "min", "max", "spread", "noise", "frozen", "spikes")


def _finding_rows(view: View) -> list[list[str]]:
    rows = []
    for f in reading.findings(view):
        level, where, what, cure = (str(f.get(k) or "") for k in ("level", "where", "what", "cure"))
        # The cure has a separate column.
        rows.append([level, where, what.removesuffix(cure).rstrip("; ") if cure else what, cure])
    return rows


def _actuators(view: View) -> Mapping[str, Any]:
    return reading.plain_of(view, "actuators")


def _actuator_words(view: View) -> list[str]:
    """Return what the motion says about order and signs of the actuators; nothing where no model was named."""
    told = _actuators(view)
    wrong = [str(w) for w in told.get("findings") or []]
    sure = percent(told.get("confidence"))
    if told.get("as_stated"):
        return [f"The actuators act as the model file states them (confidence {sure})."]
    return [f"Actuators against the model file: {'; '.join(wrong)} (confidence {sure})."] if wrong else []


def _actuator_rows(view: View) -> list[list[str]]:
    told = _actuators(view)
    gains, place, sign = (told.get(k) or {} for k in ("gains", "place", "sign"))
    return [
        [
            str(name),
            str(place.get(name, "–")),
            "reversed" if finite(sign.get(name)) == -1 else "as stated",
            percent(gain),
        ]
        for name, gain in gains.items()
    ]


def _agreement_rows(view: View) -> list[list[str]]:
    found = {k: a for k, a in reading.plain_of(view, "kinematics").items() if isinstance(a, Mapping)}
    digits = {"scale": 3, "correlation": 2, "lag_s": 2}
    return [
        [name, str(a.get("verdict", "")), *(number(a.get(k), d) for k, d in digits.items())]
        for name, a in found.items()
    ]


def _run_rows(view: View) -> list[list[str]]:
    runs = [r for r in view.data.get("runs") or [] if isinstance(r, Mapping)]
    return [
        [
            _run_name(r.get("run")),
            count(r.get("samples")),
            number(r.get("duration_s")),
            number(r.get("rate_hz")),
            count(r.get("gaps", 0)),
            number(r.get("longest_step_s")),
            percent(r.get("valid_share")),
        ]
        for r in runs
    ]


def _run_name(number: Any) -> str:
    return "–" if number is None else str(number)


def _channel_rows(view: View) -> list[list[str]]:
    found = {k: c for k, c in reading.plain_of(view, "channels").items() if isinstance(c, Mapping)}
    return [
        [
            name,
            str(c.get("unit") or "–"),
            percent(c.get("missing_share")),
            *(number(c.get(k)) for k in ("min", "max", "std", "noise_std")),
            percent(c.get("frozen_share")),
            count(c.get("spikes", 0)),
        ]
        for name, c in found.items()
    ]


def _sentence(finding: Mapping[str, Any], cure: bool = False) -> str:
    where, what = (str(finding.get(k) or "").rstrip(".") for k in ("where", "what"))
    words = what if not where or what.startswith(f"{where} ") else f"{where}: {what}"
    correct = str(finding.get("cure") or "").rstrip(".")
    # Some findings name their cure in the same breath.
    return f"{words} ({correct})" if cure and correct and correct not in words else words


def _timeline_caption(view: View) -> str:
    words = "One row per channel, all runs one after the other. Dark is missing, hatched is a gap in time."
    missing = {
        name: share
        for name, c in reading.plain_of(view, "channels").items()
        if isinstance(c, Mapping) and (share := finite(c.get("missing_share")))
    }
    if missing:
        worst = max(missing, key=lambda n: missing[n])
        return f"{words} Most is missing of {worst}: {percent(missing[worst])}."
    return f"{words} No sample is missing."


def _agreement_words(view: View) -> list[str]:
    known = {c["channel"]: s for c in reading.checks(view) if (s := finite(c["slope"])) is not None}
    wrong = [common.channel_words(c) for c, s in known.items() if s < 0]
    if wrong:
        return [f"Against the derivative of attitude and position, the sign of {listing(wrong)} is reversed."]
    right = [c for c, s in known.items() if abs(s - 1) <= 0.2]
    if known and len(right) == len(known):
        return [
            f"{listing(right)} {'agree' if len(right) > 1 else 'agrees'} with the derivative of attitude and "
            "position."
        ]
    return []


def _excitation_words(view: View) -> list[str]:
    found = reading.plain_of(view, "excitation")
    directions = {k: e for k, e in found.get("directions", found).items() if isinstance(e, Mapping)}
    still = [common.channel_words(c) for c, e in directions.items() if e.get("excited") is False]
    if not directions or not any("excited" in e for e in directions.values()):
        return []
    if still:
        return [f"Too little moves in {listing(still)} to find coefficients there."]
    return ["All six degrees of freedom move well beyond their noise."] if len(directions) == 6 else []


PAGE = QualityPage()
