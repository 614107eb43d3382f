"""Windows that are linear about given trajectories, and the trajectories that measurements make likely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.estimation.trajectories.filtered_states import filtered_states
from auvnn.estimation.trajectories.smoothed_states import smoothed_states
from auvnn.estimation.window_normal_equations import linearise
from auvnn.metrics.coloured_noise import NoiseColour
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.free_run import initial_states, moved, predict
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import make_log, small_vehicle

RMS, TIME = np.array([8.0, 8.0, 8.0, 0.8, 0.8, 1.0]), 1.0
SIGMA = np.array([0.02] * 3 + [0.003] * 3 + [0.004] * 6 + [np.inf] * 6)


def motion(model, windows, initial):
    with torch.no_grad():
        return torch.cat(predict(model.without_absent(), windows, initial), dim=-1)


@pytest.mark.parametrize(
    "hidden", [{}, {"thruster_lag": {"time_constant": 0.3}}, {"velocity_scale": {"factor": 1.2}}]
)
def test_about_free_running_itself_nothing_changes(hidden):
    model = GreyBox(small_vehicle()).with_effects(hidden) if hidden else GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model, runs=1, duration=12.0))
    initial = initial_states(model, windows)
    names = list(hidden)
    plain = list(linearise(model, windows, initial, names))
    about = replace(windows, around=motion(model, windows, initial))
    for one, other in zip(plain, linearise(model, about, initial, names), strict=True):
        for name in ("error", "state", "parameters"):
            torch.testing.assert_close(getattr(one, name), getattr(other, name), atol=1e-9, rtol=1e-7)


def test_about_a_trajectory_nearby_errors_are_those_of_free_running_to_first_order():
    model = GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model, runs=1, duration=12.0))
    initial = initial_states(model, windows)
    (plain,) = linearise(model, windows, initial, ())
    run, off = motion(model, windows, initial), []
    generator = torch.Generator().manual_seed(0)
    change = torch.randn(run.shape[0] * run.shape[1], 12, generator=generator, dtype=torch.float64)
    for size in (1e-3, 1e-4):
        around = moved(run.flatten(0, 1), size * change).unflatten(0, run.shape[:2])
        (about,) = linearise(model, replace(windows, around=around), initial, ())
        # The run from the trajectory's own first state is away from the free run by that state's change.
        first = (size * change).unflatten(0, run.shape[:2])[:, 0]
        off.append(float((about.error - plain.left(first)).abs().max()))
    assert off[0] < 2e-4 and off[1] < 0.08 * off[0]


def wandering():
    model = GreyBox(small_vehicle())
    windows = windows_for(model, wandering_log(model, RMS, TIME, runs=2, duration=15.0, seed=3), 2.0)
    times = windows.times[:, windows.warmup :]
    span = float((times[:, -1] - times[:, 0]).max())
    law = ForceLaw(RMS, np.full(6, TIME), 0.25, span)
    return model, replace(windows, law=law), initial_states(model, windows)


def test_smoothed_states_are_nearer_to_what_was_measured_than_free_running_is():
    model, windows, initial = wandering()
    run = motion(model, windows, initial)
    smoothed = smoothed_states(model, windows, initial, (), SIGMA, np.zeros(0))
    again = smoothed_states(model, replace(windows, around=smoothed), initial, (), SIGMA, np.zeros(0))

    def rms(states):
        return torch.sqrt(((states[..., 7:10] - windows.nu[..., :3]) ** 2).mean())

    # The sensor's noise is 4 mm/s; the force drives free running tens of times as far off.
    assert rms(run) > 0.03 and rms(smoothed) < 0.006
    assert float((again - smoothed)[..., 7:].abs().max()) < 0.1 * float((smoothed - run)[..., 7:].abs().max())


def test_filtered_states_know_nothing_of_what_is_measured_later():
    model, windows, initial = wandering()
    smoothed = smoothed_states(model, windows, initial, (), SIGMA, np.zeros(0))
    row, number = windows.nu.shape[1] // 2, int(windows.run[0])
    times = windows.times[:, windows.warmup :]
    moment = float(times[windows.run == number][:, row].median())
    own = torch.as_tensor(windows.run == number)[:, None]
    earlier, later = own & (times < moment - 1e-9), own & (times >= moment - 1e-9)
    nu = windows.nu.clone()
    nu[later] += 0.05
    about = replace(windows, around=smoothed)
    before, after = (filtered_states(model, w, SIGMA) for w in (about, replace(about, nu=nu)))
    torch.testing.assert_close(before[earlier], after[earlier], atol=1e-12, rtol=0.0)
    torch.testing.assert_close(before[~own[:, 0]], after[~own[:, 0]], atol=0.0, rtol=0.0)
    assert bool(((after - before)[later][:, 7:].abs() > 0.01).any())
    # At the end of a window the filter knows all that the smoother does, with cells in the place of a process.
    assert float((before - smoothed)[:, -1, 7:].abs().mean()) < 0.004


def test_a_window_begins_with_what_the_one_before_knew():
    """Two windows say what one over both says, whose filter passes where they meet."""
    model, short, initial = wandering()
    log = wandering_log(model, RMS, TIME, runs=2, duration=15.0, seed=3)
    long = replace(windows_for(model, log, 4.0), law=short.law)
    around = motion(model, long, initial_states(model, long))
    whole = filtered_states(model, replace(long, around=around), SIGMA)
    begin, places = short.times[:, short.warmup], []
    for k, number in enumerate(long.run):
        times = long.times[k, long.warmup :]
        first, second = (
            int(np.flatnonzero((short.run == number) & ((begin - t).abs() < 1e-9).numpy())[0])
            for t in (times[0], times[short.nu.shape[1] - 1])
        )
        places.append((k, first, second))
    size, own = short.nu.shape[1], torch.zeros(*short.nu.shape[:2], 13, dtype=torch.float64)
    own[...] = smoothed_states(model, short, initial, (), SIGMA, np.zeros(0))
    for k, first, second in places:
        own[first], own[second] = around[k, :size], around[k, size - 1 : 2 * size - 1]
    parts, begins = filtered_states(model, replace(short, around=own), SIGMA), 0
    for k, first, second in places:
        if (short.run == short.run[first]).argmax() == first:
            begins += 1
            torch.testing.assert_close(parts[first], whole[k, :size], atol=1e-9, rtol=1e-9)
            torch.testing.assert_close(parts[second], whole[k, size - 1 : 2 * size - 1], atol=1e-6, rtol=1e-6)
    assert begins == 2


def test_of_noise_that_is_not_white_a_mean_over_a_long_time_is_as_uncertain_as_the_filter_takes_it():
    model, windows, initial = wandering()
    smoothed = smoothed_states(model, windows, initial, (), SIGMA, np.zeros(0))
    step = float(windows.times[0, -1] - windows.times[0, -2])
    time = np.zeros(18)
    time[3:12] = -step / np.log(0.8)
    coloured = replace(windows, around=smoothed, noise=NoiseColour(time))
    generator = np.random.default_rng(0)
    noise = np.zeros((4000, 400))
    noise[:, 0] = generator.normal(size=4000)
    for k in range(1, 400):
        noise[:, k] = 0.8 * noise[:, k - 1] + 0.6 * generator.normal(size=4000)
    # Of a mean of n independent values the standard deviation is sqrt(1 / n).
    louder = SIGMA.copy()
    louder[3:12] *= noise.mean(1).std() * np.sqrt(400)
    one = filtered_states(model, coloured, SIGMA)
    two, white = (filtered_states(model, replace(coloured, noise=None), s) for s in (louder, SIGMA))
    assert float((one - two).abs().max()) < 0.1 * float((one - white).abs().max())


def test_slopes_up_to_a_moment_do_not_change_with_the_trajectory_from_there_on():
    """Else they would go together with the error that a measurement of that moment shows."""
    model, windows, initial = wandering()
    smoothed = smoothed_states(model, windows, initial, (), SIGMA, np.zeros(0))
    row = windows.nu.shape[1] // 2
    other = smoothed.clone()
    other[:, row:, 7:] += 0.1
    names = ["quadratic_damping"]
    model = model.with_effects({"quadratic_damping": {"X": 1.0}})
    one, two = (
        next(linearise(model, replace(windows, law=None, around=around), initial, names))
        for around in (smoothed, other)
    )
    for name in ("state", "parameters"):
        before, after = getattr(one, name), getattr(two, name)
        torch.testing.assert_close(before[:, : row + 1], after[:, : row + 1], atol=1e-12, rtol=1e-9)
        assert float((before - after)[:, row + 1 :].abs().max()) > 1e-4


def test_with_a_response_of_its_own_a_force_moves_any_model_as_much():
    model, windows, initial = wandering()
    heavy = model.with_effects({"added_mass": dict.fromkeys("XYZKMN", 1.4)})
    around = smoothed_states(model, windows, initial, (), SIGMA, np.zeros(0))
    response = model.prepare().inverse.detach().numpy()
    assert windows.law is not None
    off = []
    for law in (windows.law, replace(windows.law, response=response)):
        asked = replace(windows, law=law, around=around)
        one, two = (next(linearise(m, asked, initial, ())).force for m in (model, heavy))
        assert one is not None and two is not None
        # Over one interval: later on the heavier vehicle is also damped less.
        off.append(float((one[:, 1, 6:] - two[:, 1, 6:]).abs().max() / one[:, 1, 6:].abs().max()))
    assert off[0] > 0.1 and off[1] < 0.03


def test_filtered_states_are_the_same_about_another_trajectory_nearby():
    model, windows, initial = wandering()
    smoothed = smoothed_states(model, windows, initial, (), SIGMA, np.zeros(0))
    generator = torch.Generator().manual_seed(0)
    change = 1e-3 * torch.randn(
        smoothed.shape[0] * smoothed.shape[1], 12, generator=generator, dtype=torch.float64
    )
    other = moved(smoothed.flatten(0, 1), change).unflatten(0, smoothed.shape[:2])
    one, two = (filtered_states(model, replace(windows, around=a), SIGMA) for a in (smoothed, other))
    assert float((other - smoothed).abs().max()) > 3e-3
    assert float((one - two).abs().max()) < 1e-4
