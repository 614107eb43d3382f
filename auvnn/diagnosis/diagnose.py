"""Which physical effect is missing? Test all, fit the leading ones, keep what pays on runs left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answers import Answer
from auvnn.diagnosis.advise import advise
from auvnn.diagnosis.explain import Explanation, explain, standard_errors, weigh
from auvnn.diagnosis.nuisance import Layout, lay_out, stated
from auvnn.diagnosis.probes import Probed, extent_of, probed
from auvnn.diagnosis.residual_tests import residual_tests
from auvnn.diagnosis.score import Score, inflation, similarity
from auvnn.diagnosis.unknown import depends_on
from auvnn.effects import EFFECTS
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log
from auvnn.metrics.windows import CHANNELS, Windows, cut_windows
from auvnn.models import GreyBox
from auvnn.training.absorbed import Absorption, absorption
from auvnn.training.prediction_error import (
    TRUST,
    Statistics,
    answers,
    motion,
    parameters_of,
    reduce,
    set_parameters,
)

Array = NDArray[np.float64]
HORIZON, WARMUP = 5.0, 3.0
ALPHA = 0.05
# "Something is missing, but nothing that has a name" is a claim of its own: where no effect pays on runs left
# out, it takes stronger grounds than the test that opened the search.
ALPHA_UNKNOWN = 0.001
# Explanations are refitted in full, nonlinearly, as long as their one-step evidence is within reach of the best.
LEADERS, REACH, REACH_SHARE = 4, 30.0, 0.5
# Odds of twenty to one: below that two explanations are not told apart.
ODDS = float(np.log(20.0))
# Slow residuals count as something missing when they are significant and not negligible.
SLOW_Z, SLOW_SHARE = 4.0, 0.05


@dataclass
class Diagnosis(Answer):
    """What is missing in a model; `to_dict` is `diagnosis.json` of the public contract."""

    kind = "diagnosis"
    model: str
    log: str
    verdict: str
    missing: list[str]
    steps: list[dict[str, Any]]
    candidates: list[dict[str, Any]]
    unexplained: float
    depends_on: dict[str, dict[str, float]]
    next_experiment: dict[str, Any] | None
    warnings: list[str]
    derivative: dict[str, Any]
    global_p_value: float
    similarity: tuple[list[str], Array] = field(default_factory=lambda: ([], np.eye(0)))
    explanation: Explanation | None = None
    residual_tests: dict[str, Any] = field(default_factory=dict)
    absorbed: Absorption | None = None

    @property
    def surfaces(self) -> list[dict[str, Any]]:
        """The learned damping by degree of freedom, and the range that the log covered; empty without any."""
        return [] if self.absorbed is None else self.absorbed.surfaces

    @property
    def story(self) -> list[str]:
        """The answer as a few plain sentences."""
        from auvnn.diagnosis.words import tell

        return tell(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        from auvnn.answers import plain

        names = (
            "model",
            "log",
            "derivative",
            "verdict",
            "missing",
            "steps",
            "candidates",
            "unexplained",
            "depends_on",
            "next_experiment",
            "warnings",
            "global_p_value",
            "residual_tests",
            "story",
        )
        absorbed = None if self.absorbed is None else self.absorbed.to_dict()
        return plain(
            {"schema": "auvnn/diagnosis/1", **{n: getattr(self, n) for n in names}, "absorbed": absorbed}
        )


def candidates_for(
    model: GreyBox, log: Log, wanted: str | Sequence[str] | None
) -> tuple[list[str], dict[str, list[str]]]:
    """Return the effects that can be asked for, and for the others which channels they lack."""
    if isinstance(wanted, str):
        wanted = [wanted]
    names = EFFECTS.names() if wanted is None else list(dict.fromkeys(wanted))
    needs: dict[str, list[str]] = {}
    usable = []
    for name in names:
        kind = EFFECTS.get(name)
        absent = [c for c in kind.channels if not _has(log, c)]
        absent += kind.lacks(model.vehicle, model.actuation)
        needs[name] = absent
        if not absent and (name not in model.effect_names):
            usable.append(name)
    return usable, needs


def _has(log: Log, channel: str) -> bool:
    if channel in ("phi", "theta", "psi"):
        return True
    return all(channel in run.channels for run in log.runs)


def windows_for(model: GreyBox, log: Log, window: float | None = None) -> Windows:
    """Cut a log for fitting: windows of 5 s, or shorter where that leaves fewer than twelve.

    Args:
        model: says which commands drive it.
        log: the log.
        window: another length, s. Where disturbances rather than sensors limit the prediction, short windows
            tell more: errors that a disturbance leaves grow with time, those of a sensor do not.

    Raises:
        ConfigError: a length that is no positive number.
        InputError: no run is as long.
    """
    if window is not None:
        if isinstance(window, bool) or not isinstance(window, (int, float)) or not 0 < window < np.inf:
            raise ConfigError(f"window={window} must be a number of seconds above zero")
        longest = max(run.duration for run in log.runs)
        if window > longest:
            raise InputError(
                f"window={window:g} s is longer than every run of {log.name} (the longest has {longest:.4g} s): "
                "choose a shorter window, or record longer runs"
            )
    horizon = float(np.clip(log.duration / 12, 1.0, HORIZON)) if window is None else float(window)
    return cut_windows(log, horizon, warmup=WARMUP, kind=model.actuation, partial=True)


def diagnose(
    model: GreyBox,
    log: Log,
    effects: str | Sequence[str] | None = None,
    *,
    max_effects: int = 4,
    window: float | None = None,
    advice: bool = True,
    force: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Say which physical effects a model lacks, by a log.

    A global test decides whether anything is missing; only then are names tried. Each is fitted jointly with
    the coefficients that are uncertain, weighed by its evidence, and kept only if free running on runs left
    out improves by more than its own uncertainty. Then the search goes on with the effect in the model.

    Args:
        model: the model as known.
        log: measurements; cross-validated over its runs. A test log has no place here.
        effects: names to consider; the whole catalogue by default.
        max_effects: look for at most this many.
        window: length of the windows of free running that are fitted, s; by default 5.
        advice: for an ambiguous answer, also work out which manoeuvre would tell the candidates apart.
        force: go on with a log that contradicts itself: signs, units, axes.
        progress: told in words what is being done.

    Raises:
        ConfigError: an unknown effect.
        InputError: the log has too little that can be used, or contradicts itself.
    """
    say = progress or (lambda words: None)
    if max_effects < 1:
        raise ConfigError(f"max_effects={max_effects} must be at least 1")
    usable, needs = candidates_for(model, log, effects)
    log.quality().refuse_contradictions(force)
    windows = windows_for(model, log, window)
    if len(windows) < 4:
        cure = "record a longer log" if window is None else "choose a shorter window, or record a longer log"
        raise InputError(f"{log.name} gives only {len(windows)} windows of free running: {cure}")
    layout = lay_out(model, usable)
    search = _Search(layout, windows, usable, say, advice)
    found = search.run(model, log, needs, max_effects)
    # A subnetwork that has swallowed an effect leaves nothing of it for the tests above to see.
    found.absorbed = absorption(model, log)
    if found.absorbed is not None:
        found.warnings += found.absorbed.words()
    return found


class _Search:
    """One diagnosis under way."""

    def __init__(
        self,
        layout: Layout,
        windows: Windows,
        usable: list[str],
        say: Callable[[str], None],
        advice: bool = True,
    ) -> None:
        self.layout, self.windows, self.usable, self.say = layout, windows, usable, say
        self.advice = advice
        # The explanations between which the log cannot decide.
        self.rivals: list[Explanation] = []
        self.base = [n for n in layout.names if n not in usable or n in layout.nuisance]
        self.floor = TRUST * motion(windows) + 1e-9
        self.silent: list[str] = []
        self.extent = extent_of(windows)

    def statistics(self, found: Explanation, remaining: list[str]) -> tuple[Statistics, Layout, Probed]:
        """Linearise towards every parameter at a fit, those of the remaining effects at several shapes."""
        model = self.layout.model.rebuilt(self.layout.model.copied_effects())
        set_parameters(model, found.names, found.fitted.theta)
        at = replace(self.layout, model=model)
        asked = probed(at, remaining, self.extent)
        sums, _, _ = reduce(
            self.windows,
            answers(asked.layout.model, self.windows, found.fitted.initial, asked.layout.model.effect_names),
            found.fitted.sigma,
        )
        return sums, at, asked

    def run(self, model: GreyBox, log: Log, needs: dict[str, list[str]], most: int) -> Diagnosis:
        """Search for one effect after the other."""
        self.say("fitting the uncertain coefficients")
        current = explain(self.layout, self.windows, self.base, ())
        first, chosen, steps = current, [], []
        table: dict[str, dict[str, Any]] = {}
        similar: tuple[list[str], Array] = ([], np.eye(0))
        noise_floor = None
        global_p = 1.0
        while True:
            remaining = [n for n in self.usable if n not in chosen]
            self.say(f"testing {len(remaining)} effects at the null")
            sums, at, asked = self.statistics(current, remaining)
            base = [*self.base, *[c for c in chosen if c not in self.base]]
            asked_at = {n: asked.score(sums, base, n, chosen) for n in remaining}
            scores = {n: found for n, (found, _) in asked_at.items()}
            p_value = _together([s.p_value for s in scores.values() if s.degrees])
            if not table:
                global_p = p_value
                similar = (remaining, similarity(sums, asked.layout, base, [k for _, k in asked_at.values()]))
                table = self._table(scores, current, similar, needs)
                self.silent = [n for n in remaining if not scores[n].degrees]
            missing_something = p_value < ALPHA
            if not missing_something or not remaining or len(chosen) >= most:
                verdict = "unknown" if self._slow(current) else "adequate"
                steps.append({"verdict": verdict, "effects": [], "p_value": p_value})
                break
            verdict, best, tried = self._choose(scores, at, base, chosen, current)
            for explanation in tried:
                if not chosen:
                    self._fill(table, explanation, first)
            if best is None:
                verdict = "unknown" if p_value < ALPHA_UNKNOWN or self._slow(current) else "adequate"
                steps.append({"verdict": verdict, "effects": [], "p_value": p_value})
                break
            new = [e for e in best.effects if e not in chosen]
            steps.append({"verdict": verdict, "effects": new, "p_value": p_value})
            if verdict == "ambiguous":
                break
            chosen = list(best.effects)
            current = best
            if noise_floor is None:
                noise_floor = best
        missing = [e for s in steps for e in s["effects"]]
        order = sorted(
            table.values(),
            key=lambda c: (missing.index(c["effect"]) if c["effect"] in missing else 99, -c.pop("_order")),
        )
        verdict = steps[0]["verdict"]
        before, after = _excess(first, current), _excess(current, current)
        unexplained = float(np.clip(after / before, 0.0, 1.0)) if before > 0 else 0.0
        depends = {}
        if verdict == "unknown" or steps[-1]["verdict"] == "unknown":
            depends = depends_on(current.fitted.model, log, self.windows)
        return Diagnosis(
            model.vehicle.name,
            log.name,
            verdict,
            missing,
            steps,
            order,
            0.0 if verdict == "adequate" else unexplained,
            depends,
            self._next(model),
            self._warnings(model, log),
            {
                "method": f"none: free-running windows of {self._length():g} s with estimated initial states",
                "bandwidth_hz": None,
            },
            global_p,
            similar,
            current,
            self._tests(first, current),
        )

    def _tests(self, first: Explanation, last: Explanation) -> dict[str, Any]:
        """Return the residual tests without what was found and with it."""
        self.say("testing what is left for whiteness")
        before = residual_tests(first, self.windows).to_dict()
        after = before if last is first else residual_tests(last, self.windows).to_dict()
        return {"before": before, "after": after}

    def _next(self, model: GreyBox) -> dict[str, Any] | None:
        if not (self.advice and len(self.rivals) > 1):
            return None
        return advise(model, self.layout, self.rivals, (HORIZON, WARMUP), self.say).to_dict()

    def _length(self) -> float:
        times = self.windows.times[:, self.windows.warmup :]
        return round(float((times[:, -1] - times[:, 0]).max()), 3)

    def _choose(
        self, scores: dict[str, Score], at: Layout, base: list[str], chosen: list[str], current: Explanation
    ) -> tuple[str, Explanation | None, list[Explanation]]:
        """Refit the leading effects and return the verdict, the best, and all that were refitted."""
        significant = [s for s in scores.values() if s.degrees and s.p_value < ALPHA]
        leading = sorted(significant, key=lambda s: -s.evidence)[:LEADERS]
        top = leading[0].evidence if leading else 0.0
        leading = [s for s in leading if s.evidence > min(top - REACH, REACH_SHARE * top)]
        # Evidence counts an effect of many parameters low while it is small; a test that is clear even among
        # all the others lets it be judged by what it does on runs left out.
        clear = {s.effect for s in significant if s.p_value < ALPHA / len(scores)}
        tried = []
        for candidate in leading:
            self.say(f"fitting {candidate.effect}")
            guess = at.model.rebuilt(at.model.copied_effects())
            set_parameters(
                guess,
                [candidate.effect],
                np.where(
                    np.isfinite(candidate.estimate),
                    candidate.estimate,
                    parameters_of(at.model, [candidate.effect]),
                ),
            )
            tried.append(
                explain(
                    self.layout,
                    self.windows,
                    base,
                    [*chosen, candidate.effect],
                    start=current.fitted,
                    guess=replace(at, model=guess),
                    sigma=current.fitted.sigma,
                    iterations=6,
                )
            )
        if not tried:
            return "unknown", None, []
        factor = min(self._factor(e) for e in tried)
        current = weigh(self.layout, current, factor)
        tried = sorted((weigh(self.layout, e, factor) for e in tried), key=lambda e: -e.evidence)
        paying = [
            e
            for e in tried
            if (e.evidence > current.evidence or e.effects[-1] in clear)
            and self._pays(e, self._without(e, base, current))
        ]
        if not paying:
            return "unknown", None, tried
        best = paying[0]
        rivals = [e for e in paying[1:] if best.evidence - e.evidence < ODDS]
        if rivals:
            self.rivals = [best, *rivals]
            names = tuple(e.effects[-1] for e in [best, *rivals])
            return "ambiguous", replace(best, effects=(*chosen, *names)), tried
        # The weights follow the errors that the winner leaves.
        final = explain(
            self.layout,
            self.windows,
            base,
            best.effects,
            start=best.fitted,
            guess=replace(at, model=best.fitted.model),
        )
        return "named", final, [final, *tried[1:]] if tried[0] is best else [final, *tried]

    def _factor(self, explanation: Explanation) -> float:
        sums = explanation.fitted.statistics
        return inflation(sums.slope, sums.hessian.sum(0), sums.run)

    def _without(self, after: Explanation, base: list[str], current: Explanation) -> Explanation:
        """Return the same model without the effect, everything else refitted.

        Where the effect is a coefficient group that is uncertain anyway, that group stays as stated.
        """
        effect = after.effects[-1]
        if effect not in base:
            return current
        names = [n for n in base if n != effect]
        return explain(
            self.layout,
            self.windows,
            names,
            after.effects[:-1],
            start=current.fitted,
            sigma=current.fitted.sigma,
            iterations=6,
        )

    def _pays(self, after: Explanation, before: Explanation) -> bool:
        """Whether the error on what was left out falls by more than its own uncertainty."""
        gain = before.left_out - after.left_out
        return float(gain.sum()) > float(np.sqrt(len(gain)) * gain.std(ddof=1))

    def _slow(self, explanation: Explanation) -> bool:
        """Whether the errors left are slower than white noise: something is missing, with a name or without."""
        sums = explanation.fitted.statistics
        count, pairs = sums.count.sum(0), sums.pairs.sum(0)
        spent = 12 * len(sums.cost) * count / max(count.sum(), 1.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            slow = sums.channel.sum(0) / np.maximum(count - spent, 1.0)
            fast = np.maximum(sums.rough.sum(0) / (2 * pairs), self.floor**2)
            z = (slow / fast - 1.0) * np.sqrt(count)
            share = 1.0 - fast / slow
        return bool(np.any((count > 0) & (z > SLOW_Z) & (share > SLOW_SHARE)))

    def _table(
        self,
        scores: dict[str, Score],
        current: Explanation,
        similar: tuple[list[str], Array],
        needs: dict[str, list[str]],
    ) -> dict[str, dict[str, Any]]:
        names, matrix = similar
        excess = max(_excess(current, current), max((s.gain for s in scores.values()), default=0.0), 1e-12)
        table: dict[str, dict[str, Any]] = {}
        for name, absent in needs.items():
            found = scores.get(name)
            entry: dict[str, Any] = {
                "effect": name,
                "p_value": None,
                "explained": None,
                "cv_before": None,
                "cv_after": None,
                "parameters": {},
                "confusable_with": [],
                "needs": absent,
                "_order": -np.inf,
            }
            if found is not None:
                row = names.index(name)
                near = sorted(
                    ((matrix[row, j], names[j]) for j in range(len(names)) if j != row), reverse=True
                )
                described = self.layout.model.effect(name).parameters_of
                entry.update(
                    p_value=found.p_value,
                    explained=float(np.clip(found.gain / excess, 0.0, 1.0)),
                    cv_before=current.cv,
                    cv_after=_promised(current, found),
                    parameters={
                        p.name: {"value": v, "std": s, "unit": p.unit}
                        for p, v, s in zip(described, found.estimate, found.std, strict=True)
                    },
                    confusable_with=[{"effect": n, "similarity": float(v)} for v, n in near if v >= 0.5],
                    _order=found.evidence,
                )
            table[name] = entry
        return table

    def _fill(self, table: dict[str, dict[str, Any]], explanation: Explanation, before: Explanation) -> None:
        """Replace the one-step figures of an effect by those of its own fit."""
        for name in explanation.effects:
            columns = _columns(self.layout, explanation.names, name)
            std, _ = standard_errors(explanation, columns)
            described = self.layout.model.effect(name).parameters_of
            values = explanation.fitted.theta[columns]
            table[name].update(
                cv_before=before.cv,
                cv_after=float(np.sqrt(_scaled_left_out(explanation, before) / before.left_out_count.sum())),
                parameters={
                    p.name: {"value": v, "std": s, "unit": p.unit}
                    for p, v, s in zip(described, values, std, strict=True)
                },
            )

    def _warnings(self, model: GreyBox, log: Log) -> list[str]:
        found = [*model.vehicle.warnings, *log.quality().reservations]
        if len(log.runs) < 2:
            found.append("the log holds one run: what is left out in turn are stretches of it")
        if self.silent:
            found.append(
                f"{log.name} says nothing about {', '.join(self.silent)}: nothing in it depends on them"
            )
        if not stated(model):
            found.append("no coefficient of the model is uncertain: any error of theirs will be given a name")
        return found


def _columns(layout: Layout, names: Sequence[str], wanted: str) -> NDArray[np.int64]:
    at = 0
    for name in names:
        size = len(layout.columns[name])
        if name == wanted:
            return np.arange(at, at + size)
        at += size
    raise KeyError(wanted)


def _together(p_values: list[float]) -> float:
    """Return one p-value for many dependent tests: Bonferroni's, which holds whatever the dependence."""
    return float(min(1.0, len(p_values) * min(p_values))) if p_values else 1.0


def _excess(explanation: Explanation, weights: Explanation) -> float:
    """Return the weighted squared error above what white noise alone would leave."""
    sums, sigma = explanation.fitted.statistics, weights.fitted.sigma
    noise = np.nan_to_num(weights.fitted.statistics.noise())
    usable = np.isfinite(sigma)
    count = sums.count.sum(0)
    spent = 12 * len(sums.cost) * count / max(count.sum(), 1.0)
    above = sums.channel.sum(0) - (count - spent) * noise**2
    return float(np.maximum(above[usable] / sigma[usable] ** 2, 0.0).sum())


def _promised(current: Explanation, found: Score) -> float:
    left = max(current.left_out.sum() - (found.gain - found.degrees), 0.0)
    return float(np.sqrt(left / max(current.left_out_count.sum(), 1.0)))


def _scaled_left_out(explanation: Explanation, before: Explanation) -> float:
    """Return an explanation's left-out error in the weights of the explanation before it."""
    mine, theirs = explanation.fitted.sigma, before.fitted.sigma
    if np.allclose(mine[np.isfinite(mine)], theirs[np.isfinite(mine)]):
        return float(explanation.left_out.sum())
    usable = np.isfinite(mine)
    sums = explanation.fitted.statistics.channel.sum(0)[usable]
    inflated = explanation.left_out.sum() / max(explanation.fitted.statistics.cost.sum(), 1e-12)
    return float((sums / theirs[usable] ** 2).sum() * inflated)


__all__ = ["CHANNELS", "Diagnosis", "candidates_for", "diagnose", "windows_for"]
