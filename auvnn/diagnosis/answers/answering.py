"""From the end of a search to its answer: made once, complete, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auvnn.answer_types import Candidate, NextExperiment, SearchStep
from auvnn.diagnosis.advise import advise
from auvnn.diagnosis.answers.answer import Diagnosis, Names, OneOf
from auvnn.diagnosis.answers.bounds import reservations
from auvnn.diagnosis.answers.effect_costs import Worth, worth
from auvnn.diagnosis.answers.joint import joint
from auvnn.diagnosis.answers.moved_coefficients import moved
from auvnn.diagnosis.answers.refitted_coefficients import refitted_coefficients
from auvnn.diagnosis.answers.table import fill_candidate
from auvnn.diagnosis.answers.told_names import costliest_first, known_to_pay, names_by_worth
from auvnn.diagnosis.hypotheses.candidates import HORIZON, WARMUP
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.measured_start import GROSS, noise_share
from auvnn.diagnosis.hypotheses.stated_priors import has_stated_uncertainty
from auvnn.diagnosis.residuals.additive_force_test import additive_force_test
from auvnn.diagnosis.residuals.attribution import Attribution, attribute_residual
from auvnn.diagnosis.residuals.variance_component_test import white
from auvnn.diagnosis.residuals.whiteness import residual_tests
from auvnn.diagnosis.stages.partial import without
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.effects.acting_beside import in_words, needed_beside
from auvnn.estimation.prediction_error import FitError

# A force of one measured input surer than this is reported where no smooth function of the inputs was sure enough.
SURE = 0.01


def answer(asked: Setting, state: State) -> Diagnosis:
    """Return the answer of a search."""
    notes: list[str] = list(state.notes)
    without = _fits_without(asked, state)
    found = _worth(asked, state, without, notes)
    steps, unsure = known_to_pay(
        costliest_first(state.steps, found.names, asked.tolerance), found.names, asked.tolerance
    )
    gone = {e for s in steps if s["verdict"] == "withdrawn" for e in s["effects"]}
    given = [e for s in steps for e in s["effects"] if e not in gone]
    standing = [s for s in steps if s["verdict"] != "withdrawn" and not {*s["effects"]} <= gone]
    leading = standing[0] if standing else steps[-1]
    verdict = leading["verdict"]
    depends = _depends(asked, state, verdict, notes)
    given = names_by_worth(given, found.names)
    # Of a leading group one member is to be added; what was found after it stands in the steps.
    missing = OneOf(leading["effects"]) if verdict == "ambiguous" else Names(given)
    told = dict.fromkeys([*missing, *given, *state.nearest])
    stated = {n: asked.model.effect(n).values() for n in told if n in asked.model.effect_names}
    missing.refit = any(n in stated for n in missing)
    return Diagnosis(
        model=asked.model.vehicle.name,
        log=asked.log.name,
        verdict=verdict,
        missing=missing,
        steps=[s.copy() for s in steps],
        candidates=_candidates(asked, state, given, without),
        unexplained=_unexplained(state, verdict),
        depends_on=depends.shares,
        inseparable=depends.inseparable,
        next_experiment=_next(asked, state, steps, notes),
        warnings=[*_warnings(asked, state, unsure), *notes, *asked.notes],
        absorbed=asked.absorbed,
        derivative={
            "method": f"none: free-running windows of {_length(state):g} s with estimated initial states",
            "bandwidth_hz": None,
        },
        global_p_value=state.p_value if state.left is None else min(state.p_value, state.left.p_value),
        similarity=state.similar,
        explanation=state.current,
        residual_tests=_tests(asked, state, notes),
        acts_in={} if state.left is None else state.left.shares,
        nearest=list(state.nearest),
        matters={n: c.to_dict() for n, c in found.names.items() if n in missing or n in given},
        joint=joint(asked, state, found) if state.partial else {},
        left=dict(found.left),
        small_remainder=state.negligible,
        moved=moved(asked.layout, state.current),
        tolerance=asked.tolerance.to_dict(),
        judged_by=found.words,
        stated=stated,
        unsure=unsure,
        refitted=refitted_coefficients(asked, state),
    )


def _fits_without(asked: Setting, state: State) -> dict[str, FittedHypothesis]:
    """Return the fit without each name of the answer, everything else refitted.

    A coefficient group that is uncertain anyway stays as it was stated: following the log, it would take up its own name.
    """
    found = {}
    for name in state.current.effects:
        try:
            found[name] = without(asked, state, state.current, name, as_stated=True)
        except FitError:
            continue
    return found


def _worth(asked: Setting, state: State, without: Mapping[str, FittedHypothesis], notes: list[str]) -> Worth:
    try:
        return worth(asked, state, without)
    except (np.linalg.LinAlgError, FloatingPointError):
        notes.append("what the names cost could not be worked out: free running leaves what is finite")
        return Worth()


def _candidates(
    asked: Setting, state: State, given: list[str], without: Mapping[str, FittedHypothesis]
) -> list[Candidate]:
    """Return the table of candidates, those given first, then by their evidence."""
    table = dict(state.table)
    # What was tried alone at first has other values beside what was found since.
    for explanation in (e for group in state.groups for e in group):
        table = fill_candidate(asked.layout, table, explanation, state.first)
    table = fill_candidate(asked.layout, table, state.current, state.first, without)
    for name, reason in state.failed.items():
        if name not in state.current.effects:
            table[name] = replace(table[name], reason=reason)
    for name in {*table} & {*asked.model.effect_names} - {*asked.usable}:
        if table[name].needs:
            continue
        table[name] = replace(table[name], reason="the model has it, and it has a shape: not asked for")
    names = [*given, *(n for n in state.nearest if n not in given)] if state.partial else given
    rows = sorted(
        table.values(),
        key=lambda c: (names.index(c.effect) if c.effect in names else len(table), -c.order),
    )
    return [row.to_dict() for row in rows]


def _unexplained(state: State, verdict: str) -> float:
    """Return the share that nothing explains: none where what is left is noise, or does not matter."""
    if verdict == "adequate" or state.steps[-1]["verdict"] == "adequate":
        return 0.0
    return round(state.unexplained, 6)


def _depends(asked: Setting, state: State, verdict: str, notes: list[str]) -> Attribution:
    if verdict not in ("unknown", "partial") and state.steps[-1]["verdict"] != "unknown":
        return Attribution({}, {})
    asked.say("tracing what is left to the measured inputs")
    found = Attribution({}, {})
    try:
        found = attribute_residual(state.current, state.windows)
        if any(found.shares.values()):
            return found
        traced = state.traced
        if traced is None or state.current is state.first:
            noise = white(state.current, asked.floor)
            traced = additive_force_test(state.current, asked.layout, state.windows, noise, (), SURE)
    except np.linalg.LinAlgError:
        notes.append("what is left could not be traced to the measured inputs: its sums cannot be solved")
        return found
    if traced.p_value < SURE:
        return Attribution({**found.shares, traced.axis: {traced.input: traced.share}}, {})
    return found


def _tests(asked: Setting, state: State, notes: list[str]) -> dict[str, Any]:
    """Return the residual tests without what was found and with it."""
    if not asked.whiteness:
        return {}
    asked.say("testing what is left for whiteness")
    first, last = state.first, state.current
    try:
        before = residual_tests(first, state.windows).to_dict()
        after = before if last is first else residual_tests(last, state.windows).to_dict()
    except np.linalg.LinAlgError:
        notes.append("what is left could not be tested for whiteness: its sums cannot be solved")
        return {}
    return {"before": before, "after": after}


def _next(
    asked: Setting, state: State, steps: Sequence[SearchStep], notes: list[str]
) -> NextExperiment | None:
    vehicle = asked.model.vehicle
    first = next(({*s["effects"]} for s in steps if s["verdict"] == "ambiguous"), set())
    group = next((g for g in state.groups if first & {e.effects[-1] for e in g}), ())
    # Manoeuvres are made of forces: a glider has none, and a measured attitude follows none.
    if not (asked.advice and group) or vehicle.glides:
        return None
    try:
        return advise(asked.model, asked.layout, list(group), (HORIZON, WARMUP), asked.say).to_dict()
    except (np.linalg.LinAlgError, FitError):
        notes.append("which manoeuvre would decide could not be worked out: the candidates diverge on them")
        return None


def _length(state: State) -> float:
    times = state.windows.times[:, state.windows.warmup :]
    return round(float((times[:, -1] - times[:, 0]).max()), 3)


def _warnings(asked: Setting, state: State, unsure: Sequence[str] = ()) -> list[str]:
    log, found = asked.log, [*asked.model.vehicle.warnings, *asked.log.quality().reservations]
    if len(log.runs) < 2:
        found.append("the log holds one run: what is left out in turn are stretches of it")
    there = (*asked.usable, *asked.model.effect_names)
    alone = {n: needed for n in asked.usable if (needed := needed_beside(n, there))}
    found += [f"{n} does nothing by itself: name {in_words(needed)} with it" for n, needed in alone.items()]
    able = {n for n in asked.usable if not needed_beside(n, asked.model.effect_names)}
    far = {*state.silent} >= able and noise_share(state.first.fitted) < GROSS
    if state.silent and far:
        found.append(
            f"free running over {_length(state):g} s is so far from the measurements that no effect of a plausible size "
            "shows beside the error: look for gross errors with auvnn check and auvnn compare, or state a shorter window"
        )
    elif state.silent:
        them = "it" if len(state.silent) == 1 else "them"
        found.append(f"the log says nothing about {', '.join(state.silent)}: nothing in it depends on {them}")
    if not has_stated_uncertainty(asked.model):
        found.append("no coefficient of the model is uncertain: any error of theirs will be given a name")
    found += reservations(asked.layout, state.current, state.current.effects)
    if beside := state.current.beside:
        found.append(
            f"not named, but likely beside what is named: {', '.join(beside)} (too little effect in free running, or "
            "more names than max_effects); the standard errors allow for this"
        )
    if unsure:
        found.append(
            f"not named: {', '.join(unsure)} (the log is likelier with it, but it is not known to improve predictions of "
            "runs left out, beside what is named)"
        )
    found += [f"{name} was no candidate any more: {why}" for name, why in state.failed.items()]
    return found
