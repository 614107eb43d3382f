"""An explanation with the law of the force that is most likely with it, and its marginal likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, wilcoxon

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.plausible_sizes import departure, sizes_of
from auvnn.diagnosis.hypotheses.stated_priors import Layout, correlation_root
from auvnn.diagnosis.noise_law.likelihood.estimate_law import Estimate, estimate
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import ROUGHLY, STEPS, Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction
from auvnn.diagnosis.selection.model_comparison import ALPHA_REFUTED, ODDS, confused
from auvnn.diagnosis.selection.predictive_density import gain_by_window, surely_positive
from auvnn.effects import effect_class
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Members of a group that the log cannot tell apart, at most.
GROUP = 3
# Level of the signed-rank test of gains on what is left out: windows that follow one another gain alike. Forces are
# compared by their mean over so long, s.
ALPHA_RANKS, SECOND = 0.001, 1.0
# Shares of the force of a degree of freedom: a further name must leave less, where it does not bring much of the gain of
# all names (after a large effect every other one brings little of it), or take away more where those before it do little.
LEAVES, MOST = 0.1, 0.5
# A name stands out that gains so much in evidence, and so many times what every effect does that is not confused with it.
AHEAD, TIMES = 100.0, 4.0
# Share of the gain by which an effect that is known to be confused with the best may fall short of it.
CLOSE = 0.1


@dataclass(frozen=True)
class Hypothesis:
    """An explanation with the law of the force that is most likely with it.

    Attributes:
        explanation: fitted without a force, with its sums under its own law beside.
        estimate: its own law, and its likelihood there.
        misfit: minus twice the log marginal likelihood, departure of the parameters in it, their volume aside.
        evidence: logarithm of the marginal likelihood, up to what all hypotheses of a log share.
        promised: by how much more the misfit is where the parameters are, and not yet where the law moves them.
    """

    explanation: FittedHypothesis
    estimate: Estimate
    misfit: float
    evidence: float
    promised: float = 0.0

    @property
    def weighed(self) -> FittedHypothesis:
        """The explanation in the sensors' white noise, with its windows' sums under its own law."""
        return under_its_law(self.explanation)

    @property
    def here(self) -> Hypothesis:
        """The same without what a step only promises."""
        worse = self.promised
        return replace(self, misfit=self.misfit + worse, evidence=self.evidence - 0.5 * worse, promised=0.0)

    @property
    def name(self) -> str:
        """The effect that came last."""
        return self.explanation.effects[-1] if self.explanation.effects else ""


@dataclass(frozen=True)
class WithForce:
    """What was found together with a stochastic force.

    Attributes:
        steps: of the search.
        groups: explanations between which the log cannot decide.
        last: the fit with what was found.
        windows: with that law.
        estimate: the law.
        tried: all that were fitted at first, the best first.
        p_value: of there being nothing with a name.
        first_law: the law without any name.
        compared: what is left, as forces that the inertia without any name needs: a name may scale thrust and inertia.
        predicted: what measured inputs predict of the force that is left; None where that is little.
        stands_out: whether the first name explains far more than all that is not confused with it.
        explains: whether it leaves next to nothing of the force in a degree of freedom.
        worsens: whether all names together make free running worse.
    """

    steps: list[SearchStep]
    groups: list[list[FittedHypothesis]]
    last: FittedHypothesis
    windows: Windows
    estimate: Estimate
    tried: list[FittedHypothesis]
    p_value: float
    first_law: ForceLaw | None
    compared: ForceLaw | None
    predicted: InputPrediction | None = None
    stands_out: bool = False
    explains: bool = False
    worsens: bool = False


def under_its_law(explanation: FittedHypothesis) -> FittedHypothesis:
    """Return an explanation whose fit is the one with sums under its law."""
    return (
        explanation if explanation.under_law is None else replace(explanation, fitted=explanation.under_law)
    )


def judged(
    layout: Layout,
    explanation: FittedHypothesis,
    sums: ForceSums,
    sigma: Array,
    law: ForceLaw,
    most: int = STEPS,
) -> Hypothesis:
    """Return an explanation with the law that is most likely with it, and what they are worth.

    Args:
        layout: stated values.
        explanation: fitted under some law.
        sums: of its windows.
        sigma: (18,) the sensors' white noise that they were weighed by.
        law: to begin from; a degree of freedom without a force in it has none here.
        most: steps of the search for the likeliest law; with none the law is the one given.
    """
    likelihood = Likelihood(sums)
    found = estimate(likelihood, law, law.axes, most, ROUGHLY)
    names, effects, priors = explanation.names, explanation.effects, explanation.fitted.priors
    sizes = sizes_of(layout, names, effects)
    root = correlation_root(layout, names, effects)
    information = found.information * sizes[:, None] * sizes
    if root is not None:
        information = root.T @ information @ root
    volume = float(np.linalg.slogdet(information + np.eye(len(sizes)))[1])

    def misfit(theta: Array, value: float) -> float:
        """Return a value with the departure from what is likely in the place of the fit's own priors."""
        return value - priors.penalty(theta) + departure(layout, names, effects, theta)

    at = explanation.fitted.theta
    whole, here = misfit(at + found.step, found.value), misfit(at, found.value + found.gain)
    own = replace(explanation.fitted, statistics=likelihood.by_window(found.law), sigma=sigma)
    return Hypothesis(
        replace(explanation, under_law=own), found, whole, -0.5 * (whole + volume), here - whole
    )


def in_newtons(law: ForceLaw | None, found: FittedHypothesis) -> ForceLaw | None:
    """Return a law of accelerations as that of the forces that a fit's inertia needs for them.

    Args:
        law: with a response of its own, see `ForceLaw`, or without.
        found: the fit.
    """
    model = found.fitted.model.without_absent(found.effects)
    if law is None or law.response is None or model.time_varying:
        return law
    whole = model.prepare().total.detach().numpy() @ law.response
    return replace(law, rms=law.rms * np.abs(np.diag(whole)))


def shares_left(after: ForceLaw | None, before: ForceLaw) -> Array:
    """Return what is left of a force in each degree of freedom that had one, as a share of its mean square, (A,).

    Args:
        after: the law that is left; None where none is.
        before: the law before.
    """
    known = before.mean_over(SECOND)[before.axes]
    left = np.zeros(len(known)) if after is None else after.mean_over(SECOND)[before.axes]
    return (left / known) ** 2


def explains_an_axis(after: Hypothesis, before: Hypothesis) -> bool:
    """Whether an effect leaves next to nothing of the force in a degree of freedom.

    Args:
        after: hypothesis with the effect.
        before: hypothesis without it.
    """
    law = before.estimate.law
    return law is not None and bool((shares_left(after.estimate.law, law) < LEAVES).any())


def brings_most(after: Hypothesis, before: Hypothesis, null: Hypothesis) -> bool:
    """Whether an effect takes away most of the force of a degree of freedom, and more of it than all names before it.

    What names get wrong leaves a force where they act, which a further name may take up. It is less than they explain.

    Args:
        after: hypothesis with the effect.
        before: hypothesis with the names before it.
        null: hypothesis without any name.
    """
    law, known = before.estimate.law, null.estimate.law
    if law is None or known is None or not {*law.axes} <= {*known.axes}:
        return False
    left = shares_left(after.estimate.law, law)
    earlier = shares_left(law, known)[[known.axes.index(i) for i in law.axes]]
    return bool(((left < 1.0 - MOST) & (earlier * (1.0 - left) > 1.0 - earlier)).any())


def stands_out(first: Hypothesis, found: Sequence[Hypothesis], before: Hypothesis) -> bool:
    """Whether a name gains far more than every other that the catalogue does not know to be confused with it.

    Args:
        first: the hypothesis with the name.
        found: all that were fitted in its round.
        before: the hypothesis without it.
    """
    gain = first.evidence - before.evidence
    rest = [h for h in found if h.name != first.name and not confused(h.name, first.name)]
    others = [h.evidence - before.evidence for h in rest]
    return gain > AHEAD and gain > TIMES * max(others, default=0.0)


def p_value_of(layout: Layout, after: Hypothesis, before: Hypothesis) -> float:
    """Return the p-value of the effects that came last, by the likelihood ratio at laws of their own.

    Args:
        layout: for the number of the effect's parameters.
        after: the fit with it.
        before: the fit without it.
    """
    return float(chi2.sf(max(before.misfit - after.misfit, 0.0), _degrees(layout, after, before)))


def _degrees(layout: Layout, after: Hypothesis, before: Hypothesis) -> int:
    """Return how many parameters the last effect has, and those that came with it."""
    names = {*after.explanation.effects} - {*before.explanation.effects} | {after.name}
    return sum(len(layout.columns[n]) for n in names)


def tied(layout: Layout, good: list[Hypothesis], before: Hypothesis) -> list[Hypothesis]:
    """Return the best and those that the log cannot tell from it, the plainer one first.

    The law of the force is no more than near the truth, and what it gets wrong grows with what is explained: of two
    effects that the catalogue knows to be confused, one that explains nearly as much as the best is not refuted, nor is
    one that is as likely: more parameters also take up what no effect explains. Where more are alike than a group may
    hold, it is the one that explains the trace more plainly than all others, if there is one, and the best of these.

    Args:
        layout: for the number of an effect's parameters.
        good: explanations with one effect more, the most evident first.
        before: the explanation without it.
    """
    best = good[0]
    for other in good[1:]:
        # Evidence weighs how large parameters might have been, which is a guess: it must not outvote the fit.
        extra = _degrees(layout, other, before)
        if best.misfit - other.misfit > chi2.isf(ALPHA_REFUTED, extra):
            best = other
    mine = _degrees(layout, best, before)
    alike, near = [], []
    for h in (h for h in good if h is not best):
        worse, likely = h.misfit - best.misfit, best.evidence - h.evidence < ODDS
        if likely and worse < chi2.isf(ALPHA_REFUTED, mine):
            alike.append(h)
        elif confused(best.name, h.name) and (likely or worse < CLOSE * (before.misfit - best.misfit)):
            near.append(h)
    # Those that are only nearly as good never make a group too large to be given.
    group = [best, *alike, *near[: max(GROUP - 1 - len(alike), 0)]]
    plainest = [h for h in group if all(h is o or h.name in effect_class(o.name).plainer for o in group)]
    if len(group) > GROUP and plainest:
        return [*plainest, *[h for h in group if h not in plainest][: GROUP - 1]]
    plainer = effect_class(best.name).plainer
    return sorted(group, key=lambda h: h.name not in plainer)


def predicts_better(after: Hypothesis, before: Hypothesis, least: float, *, ranks: bool = True) -> bool:
    """Whether runs left out are predicted better: surely in the mean (`surely_positive`), or in most windows.

    An effect that shows in few windows has a mean gain and none in most of them. One that shows in most may have a mean
    that a few windows decide, in which the sensors or the linear motion are wrong whatever is named; its ranks are sure.

    Args:
        after: hypothesis that is to predict better.
        before: hypothesis that it is compared with.
        least: standard errors that the mean gain must exceed.
        ranks: whether most windows are enough.

    Reference: Wilcoxon (1945), Biometrics Bulletin 1(6), for the signed-rank test.
    """
    gain = gain_by_window(after.weighed, before.weighed)
    if surely_positive(gain, least):
        return True
    if not ranks:
        return False
    finite = bool(np.isfinite(gain).all()) and bool((gain != 0.0).any())
    return finite and float(np.asarray(wilcoxon(gain, alternative="greater"))[1]) < ALPHA_RANKS
