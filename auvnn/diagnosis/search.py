"""The search: test every effect at the null, take one, look again with it in the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.advise import advise
from auvnn.diagnosis.answers.answer import Diagnosis
from auvnn.diagnosis.answers.table import candidate_table, fill_candidate
from auvnn.diagnosis.hypotheses.candidates import HORIZON, WARMUP
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.layout import Layout, has_stated_uncertainty
from auvnn.diagnosis.hypotheses.refine_step import refine_step
from auvnn.diagnosis.residuals.additive_force import additive_force_test
from auvnn.diagnosis.residuals.attribution import attribute_residual
from auvnn.diagnosis.residuals.autocorrelation import is_autocorrelated
from auvnn.diagnosis.residuals.variance_component import Unnamed, variance_component_test, white
from auvnn.diagnosis.residuals.whiteness import residual_tests
from auvnn.diagnosis.score_tests.null_tests import NullTests
from auvnn.diagnosis.selection.choose import ALPHA, Chooser
from auvnn.estimation.normal_equations import TRUST, motion
from auvnn.logs import Log
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Once something is in the model the question is asked again, and each time chance gets another turn.
ALPHA_NEXT = 0.01
# "Something is missing, but nothing that has a name" is a claim of its own: where no effect pays on runs left
# out, it takes stronger grounds than the test that opened the search.
ALPHA_UNKNOWN = 0.001
# A name that leaves a force is refuted on weaker grounds: to be silent about a cause costs less than a wrong one.
ALPHA_LEFT = 0.01
# Names that leave more than this share of what looks like a force have stood in for something without a name.
PARTIAL = 0.1


class Search:
    """One diagnosis under way."""

    def __init__(
        self,
        layout: Layout,
        windows: Windows,
        usable: list[str],
        say: Callable[[str], None],
        advice: bool = True,
        whiteness: bool = True,
    ) -> None:
        self.layout, self.windows, self.usable, self.say = layout, windows, usable, say
        self.advice, self.whiteness = advice, whiteness
        self.chooser = Chooser(layout, windows, say)
        # Explanations between which the log cannot decide; the first of each group stands for it in what follows.
        self.groups: list[list[FittedHypothesis]] = []
        self.base = [n for n in layout.names if n not in usable or n in layout.nuisance]
        self.floor = TRUST * motion(windows) + 1e-9
        self.silent: list[str] = []
        self.tests = NullTests(layout, windows, say)
        self.extent = self.tests.extent
        # The force that is left, where one is; and names that explain a part of it only.
        self.left: Unnamed | None = None
        self.nearest: list[str] = []
        self.unexplained = 1.0
        # The fit of what is uncertain alone, once it has been made.
        self.first: FittedHypothesis | None = None
        # How much the effects that were asked for first look like one another.
        self.similar: tuple[list[str], Array] = ([], np.eye(0))

    def run(self, model: GreyBox, log: Log, needs: dict[str, list[str]], most: int) -> Diagnosis:
        """Search for one effect after the other."""
        self.say("fitting the uncertain coefficients")
        self.first = first = current = self._finer(fit_hypothesis(self.layout, self.windows, self.base, ()))
        chosen, steps = [], []
        # What turned out to have stood in for something else is not asked for again.
        withdrawn: list[str] = []
        table: dict[str, dict[str, Any]] = {}
        global_p = 1.0
        while True:
            remaining = [n for n in self.usable if n not in {*chosen, *withdrawn, *self._in_groups()}]
            self.say(f"testing {len(remaining)} effects at the null")
            base = [*self.base, *[c for c in chosen if c not in self.base]]
            tested = self.tests(current, remaining, base, chosen, alike=not table)
            p_value = tested.p_value
            if not table:
                global_p = p_value
                self.similar = (remaining, tested.alike)
                table = candidate_table(self.layout, tested.scores, current, self.similar, needs)
                self.silent = [n for n in remaining if not tested.scores[n].degrees]
            if p_value >= (ALPHA_NEXT if chosen else ALPHA) or not remaining or len(chosen) >= most:
                steps.append({"verdict": self._rest(current), "effects": [], "p_value": p_value})
                break
            choice = self.chooser.choose(tested.scores, tested.at, base, chosen, current)
            for explanation in choice.tried:
                if not chosen:
                    fill_candidate(self.layout, table, explanation, first)
            if choice.best is None:
                verdict = "unknown" if p_value < ALPHA_UNKNOWN else self._rest(current)
                steps.append({"verdict": verdict, "effects": [], "p_value": p_value})
                break
            new = [e for e in choice.best.effects if e not in chosen]
            if choice.verdict == "ambiguous":
                new = [e.effects[-1] for e in choice.rivals]
                self.groups.append(choice.rivals)
            steps.append({"verdict": choice.verdict, "effects": new, "p_value": p_value})
            current, gone = choice.best, []
            if chosen:
                current, gone = self.chooser.withdrawn(choice.best, self.base)
            if gone:
                gone = self._dropped(gone)
                withdrawn += gone
                steps.append({"verdict": "withdrawn", "effects": gone, "p_value": p_value})
            chosen = list(current.effects)
            current = self._finer(current)
        current = self._regrouped(steps, current)
        steps, current = self._settled(steps, first, current)
        if self.left is not None:
            global_p = min(global_p, self.left.p_value)
        # What was tried alone at first has other values beside what was found since.
        for explanation in (*(e for group in self.groups for e in group), current):
            fill_candidate(self.layout, table, explanation, first)
        return self._answer(model, log, first, current, steps, table, global_p)

    def _finer(self, found: FittedHypothesis) -> FittedHypothesis:
        """Return a fit with steps so short that what the integrator gets wrong has no say in what follows."""
        windows = refine_step(found.fitted.model, self.windows, found.fitted.initial, found.fitted.sigma)
        if windows is self.windows:
            return found
        self.say("fitting again with shorter steps")
        self.windows = windows
        self.chooser = replace(self.chooser, windows=windows)
        self.tests = NullTests(self.layout, windows, self.say)
        guess = replace(self.layout, model=found.fitted.model)
        return fit_hypothesis(self.layout, windows, self.base, found.effects, start=found.fitted, guess=guess)

    def _in_groups(self) -> list[str]:
        """Return the members of all groups between which the log cannot decide."""
        return [e.effects[-1] for group in self.groups for e in group]

    def _dropped(self, names: list[str]) -> list[str]:
        """Forget the groups for which some names stand; return these names with all members."""
        out = list(names)
        for group in [g for g in self.groups if g[0].effects[-1] in names]:
            self.groups.remove(group)
            out += [e.effects[-1] for e in group[1:]]
        return out

    def _regrouped(self, steps: list[dict[str, Any]], last: FittedHypothesis) -> FittedHypothesis:
        """Look at each group again beside what was found after it; return the fit with what is taken then.

        The errors of what had not been found yet may have hidden the difference.
        """
        for k, group in enumerate(list(self.groups)):
            names = [e.effects[-1] for e in group]
            if {*last.effects} == {*group[0].effects}:
                continue
            self.say(f"asking again which of {', '.join(names)} it is")
            left = self.chooser.regrouped(last, self.base, group)
            last, self.groups[k] = left[0], left
            if last.effects[-1] != names[0]:
                # What stopped the search was said of another member.
                steps[-1]["verdict"] = self._rest(last)
            step = next(s for s in steps if s["effects"] == names)
            step["effects"] = [e.effects[-1] for e in left]
            if len(left) == 1:
                step["verdict"] = "named"
        self.groups = [group for group in self.groups if len(group) > 1]
        return last

    def _settled(
        self, steps: list[dict[str, Any]], first: FittedHypothesis, last: FittedHypothesis
    ) -> tuple[list[dict[str, Any]], FittedHypothesis]:
        """Return the steps as they stand once what nobody has named has been asked for, and the fit that they leave.

        Nothing is adequate, and no name the whole cause, while a force is left that is beyond doubt. Where the names
        that were given leave much of it, or none of them is needed beside the force of a measured input that is left,
        they were the nearest that the catalogue has, and are not given as names. One of several that is not needed
        beside that force is withdrawn.

        Args:
            steps: the search's.
            first: the fit without any effect.
            last: the fit with what was found.
        """
        self.say("asking whether a force without a name is left")
        noise = white(last, self.floor)
        left = variance_component_test(last, self.windows, noise)
        # What was withdrawn is none of the names that stand.
        standing = {*last.effects, *self._in_groups()}
        given = [
            e for s in steps if s["verdict"] in ("named", "ambiguous") for e in s["effects"] if e in standing
        ]
        if not given:
            return (steps, last) if left.p_value >= ALPHA_UNKNOWN else (self._left(steps, left), last)
        own = [e for e in given if e in last.effects]
        self.unexplained = left.left_of(variance_component_test(first, self.windows, noise))
        self.say("asking whether a force of what is measured is left")
        traced = additive_force_test(last, self.layout, self.windows, noise, own, ALPHA_NEXT)
        sure = traced.p_value < ALPHA_LEFT
        needless = list(traced.needless) if sure else []
        much = self.unexplained > PARTIAL and min(left.p_value, traced.p_value) < ALPHA_LEFT
        if much or (own and len(needless) == len(own)):
            noise = white(first, self.floor)
            self.left, self.nearest, self.groups = (
                variance_component_test(first, self.windows, noise),
                given,
                [],
            )
            return [{"verdict": "unknown", "effects": [], "p_value": steps[0]["p_value"]}], first
        p_value = min(left.p_value, traced.p_value)
        if needless:
            last = self.chooser.without(last, self.base, needless)
            gone = {"verdict": "withdrawn", "effects": self._dropped(needless), "p_value": traced.p_value}
            return self._left([*steps[:-1], gone, steps[-1]], left, p_value), last
        if p_value >= ALPHA_UNKNOWN:
            return steps, last
        return self._left(steps, left, p_value), last

    def _left(
        self, steps: list[dict[str, Any]], left: Unnamed, p_value: float | None = None
    ) -> list[dict[str, Any]]:
        """Return the steps with a last one that says that a force is left."""
        self.left, p_value = left, left.p_value if p_value is None else p_value
        return [
            *steps[:-1],
            {**steps[-1], "verdict": "unknown", "p_value": min(steps[-1]["p_value"], p_value)},
        ]

    def _rest(self, current: FittedHypothesis) -> str:
        """Return the verdict where no effect is asked for any more."""
        return "unknown" if is_autocorrelated(current, self.floor) else "adequate"

    def _answer(
        self,
        model: GreyBox,
        log: Log,
        first: FittedHypothesis,
        last: FittedHypothesis,
        steps: list[dict[str, Any]],
        table: dict[str, dict[str, Any]],
        global_p: float,
    ) -> Diagnosis:
        gone = {e for s in steps if s["verdict"] == "withdrawn" for e in s["effects"]}
        given = [e for s in steps for e in s["effects"] if e not in gone]
        order = sorted(
            table.values(),
            key=lambda c: (given.index(c["effect"]) if c["effect"] in given else 99, -c.pop("_order")),
        )
        standing = [s for s in steps if s["verdict"] != "withdrawn" and not {*s["effects"]} <= gone]
        leading = standing[0] if standing else steps[-1]
        verdict = leading["verdict"]
        # Of a leading group one member is to be added; what was found after it stands in the steps.
        missing = leading["effects"] if verdict == "ambiguous" else given
        depends = {}
        if verdict == "unknown" or steps[-1]["verdict"] == "unknown":
            self.say("tracing what is left to the measured inputs")
            depends = attribute_residual(last, self.windows)
        return Diagnosis(
            model.vehicle.name,
            log.name,
            verdict,
            missing,
            steps,
            order,
            0.0 if verdict == "adequate" else round(self.unexplained, 6),
            depends,
            self._next(model),
            self._warnings(model, log),
            {
                "method": f"none: free-running windows of {self._length():g} s with estimated initial states",
                "bandwidth_hz": None,
            },
            global_p,
            self.similar,
            last,
            self._tests(first, last),
            acts_in={} if self.left is None else self.left.shares,
            nearest=list(self.nearest),
        )

    def _tests(self, first: FittedHypothesis, last: FittedHypothesis) -> dict[str, Any]:
        """Return the residual tests without what was found and with it."""
        if not self.whiteness:
            return {}
        self.say("testing what is left for whiteness")
        before = residual_tests(first, self.windows).to_dict()
        after = before if last is first else residual_tests(last, self.windows).to_dict()
        return {"before": before, "after": after}

    def _next(self, model: GreyBox) -> dict[str, Any] | None:
        if not (self.advice and self.groups):
            return None
        return advise(model, self.layout, self.groups[0], (HORIZON, WARMUP), self.say).to_dict()

    def _length(self) -> float:
        times = self.windows.times[:, self.windows.warmup :]
        return round(float((times[:, -1] - times[:, 0]).max()), 3)

    def _warnings(self, model: GreyBox, log: Log) -> list[str]:
        found = [*model.vehicle.warnings, *log.quality().reservations]
        if len(log.runs) < 2:
            found.append("the log holds one run: what is left out in turn are stretches of it")
        if self.silent:
            them = "it" if len(self.silent) == 1 else "them"
            found.append(
                f"{log.name} says nothing about {', '.join(self.silent)}: nothing in it depends on {them}"
            )
        if not has_stated_uncertainty(model):
            found.append("no coefficient of the model is uncertain: any error of theirs will be given a name")
        return found
