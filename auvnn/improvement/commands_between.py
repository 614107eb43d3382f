"""How commands go between the log's samples, asked of the fits that `add` makes, and these made anew where they change.

A fit of commands that are held, where a controller changed them in between, has the coefficients make up for it: they are
off, and so is every model that is used at another rate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from auvnn.diagnosis.cross_validation.fitters import ByWindows
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, lay_out
from auvnn.diagnosis.noise_law.commands.early import clearly_between_samples
from auvnn.diagnosis.noise_law.commands.holding import holding
from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.noise_law.commands.share import with_share
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.score_tests.shape_search import searched_start
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.errors import InputError
from auvnn.improvement.fits import Fits, fitted_by
from auvnn.logs import Log
from auvnn.metrics.commands.stated import interval_of
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands

# What is said where a model stated another way for such a log.
GONE = (
    "by this log commands are held until the next sample, or it does not tell: the model no longer states that they go "
    "otherwise"
)


def states_for(model: GreyBox, interval: float) -> bool:
    """Return whether a model states how commands go between samples of such a log.

    Args:
        model: as known.
        interval: between samples of the log, s.
    """
    return model.commands is not None and model.commands.counts_at(interval)


def by_their_path(fits: Fits, model: GreyBox, names: Sequence[str], say: Callable[[str], None]) -> Fits:
    """Return the fits to commands as they go between samples; themselves where these are held, or nothing tells.

    Args:
        fits: to commands that are held.
        model: as known.
        names: effects to add.
        say: called with what is being done, in words.
    """
    if not isinstance(fits.fitter, ByWindows):
        return fits
    windows = fits.fitter.windows
    say("asking how commands go between samples")
    law = asked(fits.layout, fits.best, windows)
    interval = interval_of(windows)
    path = law.path(interval)
    if path is None:
        return (
            _stated(replace(fits, notes=(*fits.notes, GONE)), None) if states_for(model, interval) else fits
        )
    say(f"commands change between samples ({law.name}): fitting again")
    try:
        again = fitted_by(ByWindows(law.applied(windows)), model, names, say)
    except InputError:
        # What was found with held commands stands: a fit to others has nowhere to begin.
        return _stated(fits, None) if states_for(model, interval) else fits
    return _stated(replace(again, notes=(*fits.notes, *again.notes, path.words())), path)


def path_of(model: GreyBox, log: Log, names: Sequence[str] = ()) -> CommandPath | None:
    """Return how commands go by a fit of the uncertain coefficients and effects; None where held, or nothing tells.

    Args:
        model: as known.
        log: measurements.
        names: effects that are fitted with them: what is missing hides what commands do.

    Raises:
        FitError: the fit does not settle on anything finite.
    """
    windows, layout = windows_for(model, log), lay_out(model, names)
    return asked(layout, one_after_another(layout, windows, names), windows).path(interval_of(windows))


def one_after_another(layout: Layout, windows: Windows, names: Sequence[str]) -> FittedHypothesis:
    """Return the fit of what is uncertain with effects, put in one after the other.

    Args:
        layout: of the model with them.
        windows: of a log.
        names: effects, in the order in which they are put in.
    """
    base = [n for n in layout.names if n not in names or n in layout.nuisance]
    found = fit_hypothesis(layout, windows, [n for n in base if n not in names], ())
    for k in range(1, len(names) + 1):
        guess = searched_start(layout, windows, found, base, names[k - 1])
        found = fit_hypothesis(layout, windows, base, names[:k], start=found.fitted, guess=guess)
    return found


def asked(layout: Layout, fit: FittedHypothesis, windows: Windows) -> Holding:
    """Return how commands go by a fit; held unless the straight line is clearly likelier.

    Args:
        layout: of the model as it is stated.
        fit: to commands that are held.
        windows: those it was fitted to.
    """
    try:
        if not clearly_between_samples(layout, fit, windows, ODDS):
            return HELD
        return with_share(layout, fit, windows, holding(fit, windows, layout))
    except UNSOLVED:
        return HELD


def _stated(fits: Fits, path: CommandPath | None) -> Fits:
    """Return the fits with models that state how commands go."""
    return replace(
        fits,
        steps=[(name, with_commands(model, path)) for name, model in fits.steps],
        without={name: with_commands(model, path) for name, model in fits.without.items()},
    )
