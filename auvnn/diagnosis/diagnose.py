"""Which physical effect is missing? Test all, fit the leading ones, keep what pays on runs left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from auvnn.checks.doubts import doubts
from auvnn.diagnosis.answers.answer import Diagnosis
from auvnn.diagnosis.hypotheses.candidates import candidates_for, windows_for
from auvnn.diagnosis.hypotheses.layout import lay_out
from auvnn.diagnosis.hypotheses.learned_drag import with_drag_only
from auvnn.diagnosis.noise_law.answer import beside_what_is_left
from auvnn.diagnosis.search import Search
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log
from auvnn.models import GreyBox
from auvnn.training.confounding.confounded_effects import confounded_effects

LEARNED = (
    "of the learned damping only what drag can be was kept for the tests, and that was left uncertain; "
    "after adding what is named, train the subnetworks again with it in the model"
)


def diagnose(
    model: GreyBox,
    log: Log,
    effects: str | Sequence[str] | None = None,
    *,
    max_effects: int = 4,
    window: float | None = None,
    advice: bool = True,
    whiteness: bool = True,
    stochastic: bool = False,
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
        whiteness: also test what is left for correlations, before and after; no verdict depends on these tests.
        stochastic: where a force is left, also ask how commands go between samples, and for effects beside a stochastic
            force whose law is estimated; takes as long again or longer.
        force: go on with a log that contradicts itself: signs, units, axes.
        progress: told in words what is being done.

    Raises:
        ConfigError: an unknown effect.
        InputError: the log has too little that can be used, or contradicts itself.
    """
    return searched(
        model,
        log,
        effects,
        max_effects=max_effects,
        window=window,
        advice=advice,
        whiteness=whiteness,
        stochastic=stochastic,
        force=force,
        progress=progress,
    )[0]


def searched(
    model: GreyBox,
    log: Log,
    effects: str | Sequence[str] | None = None,
    *,
    max_effects: int = 4,
    window: float | None = None,
    advice: bool = True,
    whiteness: bool = True,
    stochastic: bool = False,
    force: bool = False,
    progress: Callable[[str], None] | None = None,
) -> tuple[Diagnosis, Search]:
    """Return what `diagnose` does, and the search that led to it."""
    say = progress or (lambda words: None)
    if max_effects < 1:
        raise ConfigError(f"max_effects={max_effects} must be at least 1")
    usable, needs = candidates_for(model, log, effects)
    log.quality().refuse_contradictions(force)
    windows = windows_for(model, log, window)
    if len(windows) < 4:
        cure = "record a longer log" if window is None else "choose a shorter window, or record a longer log"
        raise InputError(f"{log.name} gives only {len(windows)} windows of free running: {cure}")
    # What subnetworks have swallowed leaves no residual: only what drag can be is kept of them.
    known, spread = with_drag_only(model, log)
    layout = lay_out(known, usable, spread)
    search = Search(layout, windows, usable, say, advice, whiteness)
    found = search.run(model, log, needs, max_effects)
    if stochastic:
        found, search = beside_what_is_left(found, search, model, log, needs, max_effects)
    if spread is not None:
        found.warnings.append(LEARNED)
    found.absorbed = confounded_effects(model, log)
    if found.absorbed is not None:
        found.warnings += found.absorbed.words()
    found.warnings += doubts(model, log)
    return found, search
