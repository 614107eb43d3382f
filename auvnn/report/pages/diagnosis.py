"""The page of `diagnose`: what is missing, how sure that is, and what could be confused with it."""

from __future__ import annotations

from collections.abc import Mapping

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.pages.sections.diagnosis_words import (
    _best_of_the_rest,
    _candidate_words,
    _candidates,
    _channels,
    _dependence_words,
    _first_sentence,
    _force_words,
    _further,
    _parameter_columns,
    _parameters,
    _ranking_caption,
    _rival_words,
    _similarity,
    _whiteness,
    _whole_log,
    _with_commands,
)
from auvnn.report.pages.training import learned_plots
from auvnn.report.plots.ranking import in_order, ranking
from auvnn.report.view import View
from auvnn.report.words import finite, listing, number, p_value, percent, plural


class DiagnosisPage(Page):
    """What a diagnosis says."""

    kind = "diagnosis"

    def title(self, view: View) -> str:
        """Return the verdict as heading."""
        missing, verdict = view.texts("missing"), view.text("verdict")
        if verdict == "named" and missing and {*missing} <= {*view.mapping("stated")}:
            return f"What the model has at other values: {listing(missing)}"
        if verdict == "named" and missing:
            return f"What is missing: {listing(missing)}"
        if verdict == "adequate" and view.mapping("refitted"):
            return "The stated coefficients are off, and nothing else is missing that matters"
        return {
            "ambiguous": f"What is missing: {listing(missing, 'or')}",
            "partial": f"Something is missing, a part of which can be predicted by {listing(view.texts('nearest'))}",
            "unknown": "Something is missing, and nothing in the catalogue explains it",
            "adequate": "Nothing is missing that this log could show",
        }.get(verdict, "What is missing")

    def about(self, view: View) -> str:
        """Return model and log."""
        return f"{view.text('model', 'a model')} on {view.text('log', 'a log')}"

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        verdict, missing = view.text("verdict"), view.texts("missing")
        candidates = _candidates(view)
        by_name = {str(c.get("effect")): c for c in candidates}
        leading = [by_name[m] for m in missing if m in by_name]
        left = finite(view.get("unexplained"))
        first = _first_sentence(verdict, missing, view.mapping("stated"))
        if verdict == "adequate" and view.mapping("refitted"):
            first = "With the stated coefficients refitted nothing is missing that matters; as given the model errs more."
        out = [first, *common.baseline_words(view)[1:]]
        if verdict in ("named", "ambiguous"):
            out += [_candidate_words(c) for c in leading[:3]]
            out += _rival_words(candidates, missing)
        further = _further(view, missing)
        if further:
            lacks = [n for n in further if n not in view.mapping("stated")]
            other = [n for n in further if n in view.mapping("stated")]
            out += [f"Besides, it lacks {listing(lacks)}."] if lacks else []
            out += [f"Besides, it has {listing(other)} at other values than the log."] if other else []
            out += [_candidate_words(by_name[m]) for m in further[:3] if m in by_name]
        if unsure := view.texts("unsure"):
            out.append(f"Found beside it, but not known to improve predictions: {listing(unsure)}.")
        out += [str(w) for w in view.texts("judged_words")]
        if left is not None and left < 0.01 and verdict != "adequate":
            out.append("Next to nothing of the residual is left unexplained.")
        elif left is not None and verdict != "adequate":
            out.append(
                f"{percent(left)} of the residual's energy above the noise is explained by nothing in the "
                "catalogue."
            )
        overall = finite(view.get("global_p_value"))
        if overall is not None:
            out.append(f"That nothing at all is missing has p = {p_value(overall)}.".replace("p = <", "p <"))
        if verdict in ("unknown", "adequate"):
            out += _best_of_the_rest(candidates)
        if verdict in ("unknown", "partial"):
            out += _force_words(view)
            out += _dependence_words(view)
        after = view.mapping("next_experiment")
        if after.get("words"):
            out.append(f"Next: {str(after['words']).rstrip('.')}.")
        elif verdict == "named":
            again = " and refit=true" if {*missing} & {*view.mapping("stated")} else ""
            out.append(
                f"Next: auvnn add with effect={','.join(missing)}{again} fits it and compares before and after."
            )
        return out

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        candidates, missing = _candidates(view), view.texts("missing")
        chosen = {
            str(c.get("effect")): c["parameters"]
            for c in candidates
            if str(c.get("effect")) in missing and c.get("parameters")
        }
        return [
            Plot(
                "ranking",
                "The candidates",
                lambda: ranking(candidates, missing, nearest=view.texts("nearest")),
                lambda: _ranking_caption(candidates, missing, view.texts("nearest")),
            ),
            *(
                [Plot("parameters", "What it would be", lambda: _parameters(chosen), common.INTERVALS)]
                if chosen or missing
                else []
            ),
            Plot(
                "similarity",
                "What could be confused",
                lambda: _similarity(view),
                "How alike the marks are that two effects leave on this log: 1 means that the log cannot "
                "tell them apart, whatever the method. Framed pairs need another experiment. Shown are what is "
                "named, the leading candidates, and what is most like them; the answer holds all.",
            ),
            *_whiteness(view),
            *learned_plots(view),
        ]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        rows = []
        found = _candidates(view)
        places = {id(c): k for k, c in enumerate(found, 1)}
        for c in in_order(found, [*view.texts("missing"), *view.texts("nearest")]):
            rank = places[id(c)]
            alike = [
                f"{o.get('effect')} ({number(o.get('similarity'), 2)})"
                for o in c.get("confusable_with") or []
            ]
            cells = [percent(c.get("explained")), number(c.get("cv_before")), number(c.get("cv_after"))]
            remark = f"not judged: needs {listing(c['needs'])}" if c.get("needs") else ", ".join(alike)
            remark = str(c["reason"]) if c.get("reason") else remark
            rows.append([str(c.get("effect")), remark, str(rank), p_value(c.get("p_value")), *cells])
        steps = [
            [str(i), str(s.get("verdict", "")), listing(map(str, s.get("effects") or [])) or "–"]
            for i, s in enumerate(view.items("steps"), 1)
        ]
        fitted = {str(c.get("effect")): c["parameters"] for c in _candidates(view) if c.get("parameters")}
        depends = [
            [axis, *(percent(shares.get(channel)) for channel in _channels(view))]
            for axis, shares in view.mapping("depends_on").items()
            if isinstance(shares, Mapping)
        ]
        head = [
            "effect",
            "alike, or why not judged",
            "rank",
            "p",
            "explained",
            "cv error before",
            "cv error after",
        ]
        caption = (
            "In the order of the figure. Rank: by evidence, which weighs the fit against the number of parameters. p: "
            "how likely so large a gain would be if the effect were absent, or, of one that the model has, as stated. cv "
            "error: on runs that were not fitted."
        )
        tested = view.mapping("residual_tests").get("after")
        return [
            HtmlTable("Steps of the search", ["step", "verdict", "effects"], steps, words=3),
            *_whole_log(view),
            common.baseline_table(view),
            HtmlTable("All candidates", head, rows, caption, words=2),
            HtmlTable("Parameters of every candidate", *_parameter_columns(fitted), folded=True, words=2),
            HtmlTable(
                "What the remaining residual depends on",
                ["axis", *_channels(view)],
                depends,
                "Share of each residual that a smooth function of one measured input explains.",
            ),
            HtmlTable(
                "What is left, against the commands",
                ["velocity", "component", "correlation", "lag, s", "in half-widths of the 99 % band"],
                _with_commands(tested) if isinstance(tested, Mapping) else [],
                "Largest correlation of each velocity's error with each component of the commanded wrench before it; "
                "only what leaves its band. An actuator or inertia that is wrong shows here.",
                folded=True,
            ),
            HtmlTable(
                "What to drive next",
                ["manoeuvre", "expected standard errors"],
                [
                    [str(r.get("manoeuvre")), number(r.get("standard_errors"), 2)]
                    for r in view.mapping("next_experiment").get("ranking") or []
                    if isinstance(r, Mapping)
                ],
                "By which the wrong explanation, refitted, would miss the data of the right one.",
            ),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        derivative = view.mapping("derivative")
        return [
            ("Model", view.text("model")),
            ("Log", view.text("log")),
            ("Accelerations", common.derivative_words(derivative)),
            ("Coefficients", "the model's nominal coefficients count as uncertain by their stated amounts"),
            ("Judged by", "cross-validation over the runs of this log; a test log was not looked at"),
            ("Catalogue", plural(len(_candidates(view)), "effect")),
        ]


PAGE = DiagnosisPage()
