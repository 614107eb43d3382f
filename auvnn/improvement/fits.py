"""The fits behind `add`: the model as given, refitted, with one effect after the other, and without each of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from auvnn.diagnosis.cross_validation.fitters import ByWindows, Fitter, fitter_for
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.put_into_model import with_fitted_parameters
from auvnn.diagnosis.hypotheses.standard_errors import determined
from auvnn.diagnosis.hypotheses.stated_priors import Layout, lay_out
from auvnn.errors import InputError
from auvnn.estimation.prediction_error import FitError
from auvnn.improvement.from_parts import better_from_parts
from auvnn.logs import Log
from auvnn.models import GreyBox
from auvnn.progress import Counted

# Shares of the usual windows that are tried where no step of a fit over these leads on, and samples that they must have.
SHORTER, SAMPLES = (0.5, 0.25), 8
GIVEN, REFITTED = "as given", "coefficients refitted"


@dataclass(frozen=True)
class Fits:
    """What was fitted.

    Attributes:
        layout: what was stated.
        steps: the models of the waterfall, by name of the step.
        fits: those behind all steps but the first.
        without: effect to the model with all others; only where there are several.
        fitter: who fitted them.
        notes: what to say of the windows that were taken.
    """

    layout: Layout
    steps: list[tuple[str, GreyBox]]
    fits: list[FittedHypothesis]
    without: dict[str, GreyBox]
    fitter: Fitter
    notes: tuple[str, ...] = ()

    @property
    def final(self) -> GreyBox:
        """The model with all effects."""
        return self.steps[-1][1]

    @property
    def best(self) -> FittedHypothesis:
        """The fit with all effects."""
        return self.fits[-1]

    @property
    def stuck(self) -> bool:
        """Whether a fit of those that are compared ended where no step leads on."""
        return any(found.fitted.stuck for found in self.fits)


def fit_steps(
    model: GreyBox,
    log: Log,
    names: Sequence[str],
    *,
    objective: str,
    window: float | None,
    derivative: dict[str, Any] | None,
    say: Callable[[str], None],
) -> Fits:
    """Fit the uncertain coefficients alone, then with one effect after the other, then without each of them.

    Where a few windows are so far from linear that no step leads on, and their length was not asked for, shorter ones are
    taken.

    Args:
        model: as known.
        log: what to fit on.
        names: effects to add.
        objective: "rollout" or "one_step".
        window: length of the windows that are fitted, s; chosen by the log where None.
        derivative: how accelerations are obtained.
        say: called with what is being done, in words.

    Raises:
        ConfigError: the objective cannot fit one of the effects.
        InputError: the log says nothing about an effect, or a fit has nowhere to begin.
    """
    fitter = fitter_for(model, log, objective, window=window, derivative=derivative)
    first = fitted_by(fitter, model, names, say)
    if window is not None or not isinstance(fitter, ByWindows) or not first.stuck:
        return first
    step = float(np.median([run.dt for run in log.runs]))
    longest = step * (fitter.windows.mask.shape[1] - 1)
    for share in SHORTER:
        if longest * share < SAMPLES * step:
            break
        say(
            f"no step of a fit over windows of {longest:.3g} s leads on: fitting windows of {longest * share:.3g} s"
        )
        shorter = fitter_for(model, log, objective, window=longest * share, derivative=derivative)
        found = fitted_by(shorter, model, names, say)
        if not found.stuck:
            note = f"windows of {longest * share:.3g} s were fitted: over {longest:.3g} s no step of the fit leads on"
            return replace(found, notes=(note,))
    return first


def fitted_by(fitter: Fitter, model: GreyBox, names: Sequence[str], say: Callable[[str], None]) -> Fits:
    """Return what one fitter makes of a model.

    Args:
        fitter: who fits.
        model: as known.
        names: effects to add.
        say: called with what is being done, in words.

    Raises:
        InputError: a fit has nowhere to begin.
    """
    layout = lay_out(model, list(names))
    base = [n for n in layout.names if n not in names or n in layout.nuisance]
    say = Counted(say, 2 * len(names) + 1 if len(names) > 1 else 3)
    say("refitting the uncertain coefficients alone")
    # A coefficient group that is itself to be added stays as stated in the model that is compared with.
    nothing = fitter.fit(layout, [n for n in base if n not in names], (), None)
    steps = [(GIVEN, model), (REFITTED, with_fitted_parameters(model, layout, nothing))]
    fits = [nothing]
    for count, name in enumerate(names, 1):
        say(f"fitting with {', '.join(names[:count])}")
        try:
            found = fitter.fit(layout, base, names[:count], fits[-1])
        except FitError as problem:
            raise InputError(f"{name} cannot be added: {problem}") from None
        if isinstance(fitter, ByWindows):
            found = better_from_parts(fitter, layout, base, names[:count], found, fits[-1], say)
        fits.append(found)
        steps.append((name, with_fitted_parameters(model, layout, found)))
    without: dict[str, GreyBox] = {}
    for name in names if len(names) > 1 else ():
        others = [n for n in names if n != name]
        if name == names[-1] and name not in layout.nuisance:
            # The last step but one is just that; but what is uncertain anyway is free in it, within what is stated.
            without[name] = steps[-2][1]
            continue
        say(f"fitting without {name}")
        less = fitter.fit(layout, [n for n in base if n != name], others, fits[-1])
        without[name] = with_fitted_parameters(model, layout, less)
    return Fits(layout, steps, fits, without, fitter)


def unseen(layout: Layout, found: FittedHypothesis, names: Sequence[str], log: Log) -> list[str]:
    """Return a warning where the log says nothing about some parameters; refuse where it is all of an effect's.

    Args:
        layout: which parameters belong to which effect.
        found: the fit.
        names: effects that were asked for.
        log: for its name in the message.

    Raises:
        InputError: the log says nothing about an effect.
    """
    out, places = [], layout.places(found.names)
    for name in names:
        known = determined(found, places[name])
        if known.all():
            continue
        dark = [
            f"{name}.{p.name}"
            for p, k in zip(layout.model.effect(name).parameters_of, known, strict=True)
            if not k
        ]
        more = f" and {len(dark) - 8} more" if len(dark) > 8 else ""
        labels = ", ".join(dark[:8]) + more
        if not known.any():
            raise InputError(
                f"{log.name} says nothing about {labels}: nothing in it depends on {'it' if len(dark) == 1 else 'them'}; "
                f"fit on a log with another motion, or leave {name} out"
            )
        out.append(
            f"{log.name} says nothing about {labels}: they stay near where they were, without standard error"
        )
    return out
