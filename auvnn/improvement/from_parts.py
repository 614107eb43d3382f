"""A fit with an effect that is begun from one over parts of the windows, where most of the error is left.

Over several seconds free running depends so much on a large parameter that the squared error has many local minima: fins
that are 0.1 to 0.3 rad off were fitted at angles that predicted worse than none. Over a half or a quarter of the window
it is nearer to linear, and a fit from there ends in another minimum. Which is taken is decided by free running from the
measured states, as the model will be used: where the initial states are fitted, too, they take up what is wrong.
Reference: Bock (1983), Recent advances in parameter identification techniques for O.D.E.; Ribeiro et al. (2020), On the
smoothness of nonlinear system identification, Automatica 121, on the length of simulation and local minima.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from auvnn.diagnosis.cross_validation.fitters import ByWindows, started
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.measured_start import noise_share
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.estimation.prediction_error import SINGULAR, FitError
from auvnn.estimation.window_parts import split
from auvnn.improvement.free_run import predicted
from auvnn.metrics.rollouts import CUT
from auvnn.metrics.windows import VELOCITY, Windows
from auvnn.models import GreyBox

# Parts of the windows that are tried, and by how much the squared error must be less for their minimum to be taken.
SHARES, BETTER = (0.5, 0.25), 0.05
# They are where the noise is less than this share of the squared error that is left, and that of free running is more
# than such a share of the one without the effect, or than a tenth of the velocities' variances.
EXPLAINED, FELL, SMALL = 0.8, 0.5, 0.1


def better_from_parts(
    fitter: ByWindows,
    layout: Layout,
    base: Sequence[str],
    effects: Sequence[str],
    found: FittedHypothesis,
    before: FittedHypothesis,
    say: Callable[[str], None],
) -> FittedHypothesis:
    """Return the best of a fit and those begun from fits over parts of the windows.

    Args:
        fitter: with the windows.
        layout: stated values.
        base: effects that are free anyway.
        effects: that are asked for, the newest last.
        found: the fit with these.
        before: the fit without the newest.
        say: called with what is being done, in words.
    """
    windows, best = fitter.windows, found
    if windows.law is not None or noise_share(found.fitted) >= EXPLAINED:
        return found
    least = missed(found.fitted.model, windows)
    if least <= min(FELL * missed(before.fitted.model, windows), SMALL):
        return found
    times = windows.times[:, windows.warmup :]
    longest = float((times[:, -1] - times[:, 0]).max())
    for share in SHARES:
        parts, _, begins = split(windows, share * longest)
        if not begins.any():
            break
        say(f"most of the error is left: fitting over {share * longest:.3g} s, and from there again")
        try:
            # Begun from what is stated: of a model that lacks the effect, coefficients that fit may be far off.
            shorter = ByWindows(parts)
            short = shorter.fit(layout, base, effects, shorter.fit(layout, base, effects[:-1], None))
            guess = started(layout, short, [*base, *effects])
            again = fit_hypothesis(layout, windows, base, effects, guess=guess)
        except (FitError, np.linalg.LinAlgError, SINGULAR):
            continue
        now = missed(again.fitted.model, windows)
        if now < (1.0 - BETTER) * least:
            best, least = again, now
    return best


def missed(model: GreyBox, windows: Windows) -> float:
    """Return the mean squared error of velocities in free running from the measured states, in their variances.

    Errors of more than `CUT` standard deviations count as that.

    Args:
        model: that is run.
        windows: of a log.
    """
    seen, there = predicted(model, windows), windows.mask[..., VELOCITY].numpy() > 0
    there[:, 0] = False
    nu = windows.nu.numpy()
    std = np.array([nu[..., k][there[..., k]].std() if there[..., k].any() else 0.0 for k in range(6)])
    there &= std > 0.0
    error = np.nan_to_num((nu - seen) / np.where(std > 0.0, std, 1.0), nan=CUT)
    return float((np.clip(error, -CUT, CUT)[there] ** 2).mean()) if there.any() else 0.0
