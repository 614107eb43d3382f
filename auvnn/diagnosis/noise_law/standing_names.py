"""Names that leave so little that a stochastic force cannot refute them: they stand, and what is left is estimated.

Unless the log can do without one of them, or with another effect in its place. Under a controller commands answer the
force that is left, and a fit of output errors then takes a mass that is too large for what resists the commands. A name
without which the log is as likely under the law of the force, everything else fitted again, has taken up that force: the
search goes on without it.
"""

from __future__ import annotations

from collections.abc import Callable

from auvnn.diagnosis.hypotheses.measured_start import above_noise
from auvnn.diagnosis.noise_law.commands.uncertain import UncertainWrench
from auvnn.diagnosis.noise_law.hypothesis import in_newtons
from auvnn.diagnosis.noise_law.left_force import leaves_force, negligible, sized_by_law
from auvnn.diagnosis.noise_law.noise_colour import Colour
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction
from auvnn.diagnosis.noise_law.search import ForceSearch
from auvnn.diagnosis.noise_law.split_windows import fitted_over_parts
from auvnn.diagnosis.noise_law.withheld import state_with
from auvnn.diagnosis.residuals.variance_component_test import white
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.metrics.force_law import ForceLaw

# Names stand that leave less than such a share of the noise's square above it, and less than such a share of what was
# above it before. A force that moves the vehicle leaves more than the noise.
LITTLE, MOST_LEFT = 0.2, 1.0 / 3.0


def stand(state: State, colour: Colour) -> bool:
    """Whether the names of the first search leave so little of the error that they stand whatever the rest is.

    Sensors whose noise is not white leave errors that a test takes for a force, small beside the noise. Each part of a
    window then begins with a state of its own, and the likelihood beside such a force knows less of names than free
    running over whole windows, which they explain down to the noise.

    Args:
        state: where the first search ended.
        colour: of the sensors' noise.
    """
    if colour.noise is None or not state.chosen or state.refuted is not None:
        return False
    before, after = above_noise(state.first.fitted), above_noise(state.current.fitted)
    return after < LITTLE and after < MOST_LEFT * before


Answer = tuple[State, ForceLaw | None, InputPrediction | None] | None


def beside_names(
    asked: Setting,
    state: State,
    uncertain: UncertainWrench,
    anew: Callable[[Setting, State, UncertainWrench], Answer],
) -> Answer:
    """Return the state with its names and what is left beside them, the law of that, and what inputs predict of it.

    None where there is no such force.

    Args:
        asked: what is asked.
        state: where the first search ended.
        uncertain: what commands between samples leave uncertain.
        anew: seeks names beside the force; asked where the log needs none of those that there are.
    """
    if not leaves_force(asked, state, state.current):
        return None
    end, windows = fitted_over_parts(asked, state.current, state.windows)
    beside = ForceSearch(asked, windows, closed_loop=uncertain.closed_loop)
    found = beside.begin(end, white(end, asked.floor), 0)
    if found is None:
        return None
    path = beside.changed(found, state)
    if path is not None:
        if not path.chosen:
            return anew(asked, state, uncertain)
        first, _ = fitted_over_parts(asked, state.first, state.windows)
        result = beside.go_on(path, first, state, asked.most)
        over, chance = state.but(first=first, windows=windows), result.predicted is None
        ended = state_with(asked, state, over, result, uncertain, chance=chance)
        return ended, result.estimate.law, result.predicted
    predicted = beside.predicted(found)
    law = in_newtons(found.estimate.law, found.explanation)
    small = predicted is None and negligible(asked, state, law, uncertain)
    named = tuple(s for s in state.steps if s["effects"])
    told = state.but(
        steps=named,
        negligible=small,
        left=None,
        traced=None,
        remainder=sized_by_law(state.remainder, law, windows),
    )
    # As beside names that were found together with the force: what is stochastic is reported, and is no riddle.
    if small or predicted is not None:
        told = told.step("adequate" if small else "unknown", [], state.p_value)
    return told, law, predicted
