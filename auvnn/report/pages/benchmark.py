"""The page of `benchmark`: how often the right name is found, how often a wrong one, how sure."""

from __future__ import annotations

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages.sections import outcomes
from auvnn.report.pages.sections.benchmark_rates import other_words, p_values_of, rate_tables, target_words
from auvnn.report.pages.sections.benchmark_words import (
    MOST_CONDITIONS,
    TARGET,
    _case_table,
    _condition_table,
    _confusion,
    _interval_words,
    _naming_words,
    _null_words,
    _one_condition,
    _recovery,
    _value,
    _wrong_table,
    _wrong_words,
)
from auvnn.report.pages.sections.outcomes import rows_of, text, values
from auvnn.report.plots.coverage import coverage
from auvnn.report.plots.falls import falls
from auvnn.report.plots.recovery import in_order
from auvnn.report.plots.uniformity import uniformity
from auvnn.report.view import View
from auvnn.report.words import finite, listing, plural, prose


class BenchmarkPage(Page):
    """What a benchmark says."""

    kind = "benchmark"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "Hidden effects: how often the right one is named"

    def about(self, view: View) -> str:
        """Return vehicles and conditions."""
        rows = rows_of(view)
        vehicle, noise, excitation = (listing(values(rows, key)) for key in outcomes.CONDITION)
        return f"{vehicle}, noise {noise}, manoeuvre {excitation}: {plural(len(rows), 'log')}" if rows else ""

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        rows = rows_of(view)
        if not rows:
            return []
        hidden = outcomes.with_effect(rows)
        out = [
            *target_words(view),
            *_naming_words(hidden)[:1],
            *other_words(rows),
            *_naming_words(hidden)[1:],
        ]
        out += [_null_words(outcomes.with_nothing(rows)), _wrong_words(rows, view.mapping("metrics"))]
        out += _interval_words(hidden)
        faults = sum(text(r, "verdict") == "fault" for r in rows)
        if faults:
            out.append(f"{plural(faults, 'log')} ended in a fault instead of an answer.")
        return out

    def warnings(self, view: View) -> list[str]:
        """Return what a reader must keep in mind."""
        out = view.texts("warnings")
        if values(rows_of(view), "coefficients") == ["exact"]:
            out.append(
                "The plants' coefficients are exactly those of the model. A vehicle's are not; with "
                "coefficients=drawn they are off by their stated uncertainty."
            )
        return out

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        rows = rows_of(view)
        found = [
            Plot(
                "confusion",
                "What was hidden, and what was answered",
                lambda: _confusion(rows),
                "Each row holds the logs that hide the same. The number says how many of them got this "
                "answer in the first step, the shade their share of the row. Framed: the right answer; bold: "
                "another. Ambiguous: a group was declared that the log cannot tell apart.",
            ),
            Plot(
                "recovery",
                "How often the hidden effect is named first",
                lambda: _recovery(rows),
                "Share of the logs in which the hidden effect, and it alone, is named first, with Wilson's "
                f"95 % interval. {outcomes.size_words(rows)}".strip(),
            ),
            Plot(
                "coverage",
                "Whether the stated uncertainties are true",
                lambda: coverage(outcomes.errors(rows, "z")),
                "Errors of the parameters in units of their own standard errors, from all logs in which the "
                "hidden effect was named first. Left: true standard errors would give the drawn curve. "
                "Right: they would give points on the line; a steeper course means that the standard errors "
                "are too small, a flatter one that they are too large. Parameters of one log err together, "
                "so the points may leave the band more often than one in twenty.",
            ),
        ]
        shares = outcomes.shares_of_fall(rows)
        if shares:
            found.append(
                Plot(
                    "falls",
                    "How much better the model gets with what was found",
                    lambda: falls(shares, target=TARGET),
                    "On further runs of the same plant: the fall of the error of 5 s of free running from the nominal "
                    "model, its coefficients refitted, to the model with what was found, as a share of the fall to "
                    "the truth. Only of logs in which the truth's own fall is clear.",
                )
            )
        nulls = p_values_of(view)
        if nulls:
            found.append(
                Plot(
                    "uniformity",
                    "Whether the tests hold what they promise where nothing is hidden",
                    lambda: uniformity(nulls),
                    "Tests of all effects on the logs that hide nothing. Left: uniform p-values give lines within "
                    "the band; below it they are too small, above too large, which is safe. Right: how often each "
                    "is below 0.05. Effects with a time or a frequency to be found are corrected for having taken "
                    "the best of several, so theirs may only be too large.",
                )
            )
        parts = outcomes.by_condition(rows)
        if 1 < len(parts) <= MOST_CONDITIONS:
            sizes = values(outcomes.with_effect(rows), "size")
            found += [_one_condition(i, *part, sizes) for i, part in enumerate(parts.items(), 1)]
        return found

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        rows = rows_of(view)
        metrics = [[str(k), _value(v)] for k, v in view.mapping("metrics").items()]
        caption = (
            "Candidates: the three that came first, whatever the verdict said of them. The seed and the "
            "options make the same log again."
        )
        return [
            *rate_tables(view),
            HtmlTable(
                "By condition",
                *_condition_table(rows),
                "Effects, nothing: logs that hide an effect, or nothing. Or in a group: named first, or in "
                "a group that the log cannot tell apart. Largest error: of a parameter, relative to the "
                "effect's size.",
                words=3,
            ),
            _case_table(view),
            HtmlTable("Logs that were not answered right", *_wrong_table(rows), caption, words=7),
            HtmlTable("Metrics", ["name", "value"], metrics),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        rows = rows_of(view)
        seeds = [str(round(s)) for s in outcomes.numbers(rows, "seed")]
        runs, duration, rate = (
            listing(f"{n:g}" for n in outcomes.numbers(rows, key)) for key in ("runs", "duration", "rate")
        )
        options = view.mapping("options")
        # A plan's parts each say by themselves how many logs they make.
        repeats = None if options.get("plan") or options.get("balanced") else finite(options.get("repeats"))
        return [
            ("Vehicles", listing(values(rows, "vehicle"))),
            ("Hidden", listing(values(rows, "hidden"))),
            ("Sizes", listing(prose(s) for s in in_order(values(rows, "size")) if s != "none")),
            ("Noise", listing(values(rows, "noise"))),
            ("Manoeuvres", listing(values(rows, "excitation"))),
            ("Coefficients", listing(values(rows, "coefficients"))),
            ("Each log", f"{runs} runs of {duration} s at {rate} Hz" if runs and duration and rate else ""),
            ("Of each kind", "" if repeats is None else plural(repeats, "log")),
            ("Seeds", " to ".join(dict.fromkeys([seeds[0], seeds[-1]])) if seeds else ""),
        ]


PAGE = BenchmarkPage()
