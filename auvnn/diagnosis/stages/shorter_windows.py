"""Shorter windows, where free running over the usual ones leaves most of the error and fits end in local minima.

Over several seconds the motion of a vehicle that is barely stable depends on the parameters so strongly that the squared
error has many local minima, and every fit from the stated model ends in one of them: nothing seems to explain the log.
Over a shorter time the same error is nearly quadratic. Errors of slow effects are smaller there, too, so that the usual
windows are the better ones wherever they can be fitted; the shorter ones are taken only where what they name leaves no
more than the sensors' noise. Reference: Bock and Plitt (1984), multiple shooting; Ribeiro et al. (2020), Automatica 121.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from auvnn.diagnosis.hypotheses.measured_start import GROSS, noise_share
from auvnn.diagnosis.noise_law.commands.stated import StatedCommands
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.stages.runaway import windows_that_hold
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.errors import InputError
from auvnn.estimation.prediction_error import SINGULAR, FitError
from auvnn.estimation.window_normal_equations import TRUST, motion

# Length of the shorter windows, s, and samples that they must have.
SHORTER, SAMPLES = 2.0, 8
# Shorter windows are asked where most of the error is left, and taken where the noise is more than this share of it.
EXPLAINED = 0.8
# Share of what is left that a name must take away for another one to be looked for.
EACH = 0.25
# By how much more than its test promises a fit may lower the squared error: over shorter windows slopes reach far.
BEYOND = 1.5


class Progress:
    """Whether names still lead to where no more than the sensors' noise is left.

    Names that leave most of the error here too are no reason to go on, nor is one that takes little of it away: beside a
    stochastic force every name does.

    Args:
        stated: effects whose uncertainty is stated. One that is set free takes what was stated of it away too, so that
            what its test promises is another matter.
    """

    def __init__(self, stated: Collection[str] = ()) -> None:
        """Begin before any name."""
        self.stated = stated
        self.before: float | None = None

    def promising(self, state: State, tested: Mapping[str, Score]) -> bool:
        """Return whether a name could take away as much as `__call__` asks for, as far as tests can tell.

        Beside a stochastic force none can, and fits of the names that lead would take most of the time.

        Args:
            state: where the search stands before a round.
            tested: the round's tests by effect.
        """
        fitted = state.current.fitted
        noise, error = noise_share(fitted), float(fitted.statistics.cost.sum())
        wanted = 1.0 - noise / max(GROSS, noise + EACH * (1.0 - noise))
        gains = [s.gain for n, s in tested.items() if s.degrees and n not in self.stated]
        most = BEYOND * max(gains, default=0.0)
        return noise >= EXPLAINED or most >= wanted * error

    def __call__(self, state: State) -> bool:
        """Return it for a search after a round.

        Args:
            state: where it stands.
        """
        before = noise_share(state.first.fitted) if self.before is None else self.before
        self.before = noise_share(state.current.fitted)
        taken = (self.before - before) / max(1.0 - before, 1e-9)
        return self.before >= EXPLAINED or (self.before >= GROSS and taken >= EACH)


def search_over_shorter(asked: Setting, state: State, search: Callable[..., State]) -> tuple[Setting, State]:
    """Return what is asked and where the search stands, over shorter windows where these explain what the others do not.

    Args:
        asked: what is asked, the windows' length not having been stated.
        state: where the search over the usual windows has ended.
        search: from what is asked, windows, and whether it is worth going on after a round and (`promising`) with one, to
            the end of a search.
    """
    step = float(np.median([run.dt for run in asked.log.runs]))
    length = step * state.windows.mask.shape[1]
    if not state.leaves_something or length < 1.5 * SHORTER or SHORTER / step < SAMPLES:
        return asked, state
    if noise_share(state.current.fitted) >= GROSS:
        return asked, state
    asked.say(f"most of the error is left: searching over windows of {SHORTER:g} s")
    try:
        windows, notes = windows_that_hold(asked.layout.model, asked.log, SHORTER, asked.driven)
        shorter = replace(asked, floor=TRUST * motion(windows) + 1e-9)
        if asked.commands is not None:
            shorter = replace(shorter, commands=StatedCommands(windows, asked.commands.law))
            windows = asked.commands.law.applied(windows)
        progress = Progress(asked.layout.nuisance)
        other = search(shorter, windows, progress, promising=progress.promising)
    except (InputError, FitError, np.linalg.LinAlgError, SINGULAR):
        return asked, state
    if not other.chosen or noise_share(other.current.fitted) < EXPLAINED:
        return asked, state
    said = f"windows of {SHORTER:g} s were taken: over {length:.3g} s no fit came near the measurements"
    return replace(shorter, notes=(*asked.notes, said, *notes)), other
