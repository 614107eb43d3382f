"""What free-running windows say about parameters, as small sums: memory does not grow with the log.

Of each window the best change of its initial state is projected out, so that windows, and runs, can be left out
without another pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.estimation.force_marginalisation.columns import pushed
from auvnn.estimation.force_marginalisation.sums import LOOSE, cost_with_force, sums_with_force
from auvnn.estimation.sensitivity import Response, respond_by
from auvnn.estimation.window_simulation import BLOCK, simulate_windows
from auvnn.estimation.window_sums.kept_products import Collecting, Wanted
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.coloured_noise import previous
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]

# A channel is never trusted beyond this share of its own motion: the integrator's error and the logging's last
# digits must not pass for information.
TRUST = 1e-4
# Windows worked out at a time, as long as there are no more parameters than columns: this bounds the memory.
CHUNK, COLUMNS = BLOCK, 80
# Numbers of an answer that stay near the processor.
NEAR = 2_500_000


def motion(windows: Windows) -> Array:
    """Return the standard deviation of each channel over the windows, (18,); zero where not measured."""
    # Twice a quaternion's vector part moves like the rotation vector where the turn is small.
    euler_free = torch.cat(
        [
            windows.eta[..., :3],
            2 * windows.eta[..., 4:7],
            windows.nu,
            torch.zeros_like(windows.nu) if windows.nu_dot is None else windows.nu_dot,
        ],
        -1,
    )
    seen = windows.mask
    count = torch.clamp(seen.sum((0, 1)), min=1)
    mean = (euler_free * seen).sum((0, 1)) / count
    return torch.sqrt((((euler_free - mean) * seen) ** 2).sum((0, 1)) / count).numpy()


def linearise(
    model: GreyBox,
    windows: Windows,
    initial: Tensor,
    names: Sequence[str],
    runs: Sequence[tuple[Tensor, Tensor, Tensor]] | None = None,
    *,
    motion: slice | None = None,
) -> Iterator[Response]:
    """Yield the windows' answers chunk by chunk.

    Args:
        model: at the values about which it is linearised.
        windows: of the log, B of them.
        initial: their initial states, (B, 13).
        names: effects whose parameters are differentiated by.
        runs: what `runs_by_block` returned, where that has been done.
        motion: rows of which the change of the states themselves is kept too, see `Response`.
    """
    model = model.without_absent(names)
    columns = sum(len(model.effect(n).parameters_of) for n in names)
    # What moves is the model itself; only its slopes are asked for with a force in it.
    asked, by = model, names
    if windows.law is not None:
        asked, by = pushed(model, names)
        columns += windows.law.cells * len(windows.law.axes)
    size = max(CHUNK * COLUMNS // max(columns, COLUMNS), 1)
    for start in range(0, len(windows), BLOCK):
        block = slice(start, start + BLOCK)
        some, states = windows.pick(block), initial[block]
        begun = None if runs is None else runs[start // BLOCK]
        ran = simulate_windows(model, some, states, names, begun)
        few = max(NEAR // (some.nu.shape[1] * 18 * (12 + columns)), 1)
        for begin in range(0, len(some), size):
            part = slice(begin, begin + size)
            yield from respond_by(
                few, asked, some.pick(part), states[part], by, ran=ran.pick(part), motion=motion
            )


def normal_equations(
    windows: Windows,
    responses: Iterable[Response],
    sigma: Array,
    *,
    leverage: bool = False,
    wanted: Wanted | None = None,
) -> tuple[Statistics, Array, Array]:
    """Return the statistics of windows, and how their best initial states follow the parameters.

    Args:
        windows: B windows.
        responses: their answers, in chunks.
        sigma: (18,), infinite where a channel does not count.
        leverage: also work out the degrees of freedom that a stochastic force takes of each channel.
        wanted: products of columns to keep of each window, by default all.

    Returns:
        statistics; a (B, 12); A (B, 12, P): the best change of the initial state is a - A dtheta.
    """
    weight = weights_of(sigma)
    loose = torch.diag(torch.as_tensor(1.0 / LOOSE))
    # Channels that were not measured would only be multiplied by zero.
    weighed = torch.nonzero(weight).flatten().tolist()
    parts: list[list[Array]] = []
    adjacent = (windows.mask[:, 1:] * windows.mask[:, :-1]).sum((0, 1))
    rare = adjacent < 0.5 * windows.mask.sum((0, 1))
    begin, hessian = 0, np.zeros((len(windows), 0, 0))
    products = None if wanted is None else Collecting(wanted, len(windows))
    spent: list[Array] = []
    volume: list[Array] = []
    for answer in responses:
        count, length, told, size = answer.parameters.shape
        # Nor does a channel count that nobody measured, whatever noise it would have had.
        live = [k for k in weighed if k < told]
        here = slice(begin, begin + count)
        mask = windows.mask[here] * (weight > 0)
        begin += count
        # The largest of all arrays: made once, and not joined from pieces.
        if products is None and hessian.shape[-1] != size:
            hessian = np.empty((len(windows), size, size))
        if answer.force is not None:
            sums, solved, grown = sums_with_force(answer, weight, live, leverage=leverage)
            volume.append(grown[0])
            spent.append(grown[1])
            if products is None:
                hessian[here] = sums[:, 1:, 1:].numpy()
            first = sums[:, 0] if products is None else products.add_whole(here, sums)
            remaining = answer.left(solved[:, :12, 0])
            remaining[..., live] -= (answer.force[:, :, live] @ solved[:, None, 12:, :1]).squeeze(-1)
        else:
            both = answer.error.new_empty(count, length, len(live), 1 + size)
            both[..., 0] = answer.error[..., live]
            both[..., 1:] = answer.parameters[:, :, live]
            both = both.mul_(weight[live, None]).reshape(count, length * len(live), 1 + size)
            state = answer.state[:, :, live].mul_(weight[live, None]).reshape(count, length * len(live), 12)
            q, r = torch.linalg.qr(torch.cat([state, loose.expand(count, 12, 12)], dim=1))
            q = q[:, :-12]
            along = q.mT @ both
            # With the loose rows left out, this difference is the sum of squares after the best initial state.
            if products is None:
                sums = (both.mT @ both).sub_(along.mT @ along)
                hessian[here], first = sums[:, 1:, 1:].numpy(), sums[:, 0]
            else:
                first = products.add(here, both, along)
            solved = torch.linalg.solve_triangular(r, along, upper=True)
            remaining = answer.left(solved[..., 0])
        remaining = torch.where(mask > 0, remaining, torch.zeros_like(remaining))
        pair = mask[:, 1:] * mask[:, :-1]
        step = (remaining[:, 1:] - remaining[:, :-1]) * pair
        if rare.any():
            # Of a sensor that is slower than the log two measurements never follow row on row.
            pair, step = _since_the_last(remaining, mask, rare, pair, step)
        parts.append(
            [
                x.numpy()
                for x in (
                    first[:, 1:].clone(),
                    first[:, 0].clone(),
                    (remaining**2).sum(1),
                    mask.sum(1),
                    (step**2).sum(1),
                    pair.sum(1),
                    solved[:, :12, 0],
                    solved[:, :12, 1:],
                )
            ]
        )
    joined = [np.concatenate(p) for p in zip(*parts, strict=True)]
    slope, cost, channel, count, rough, pairs, change, follow = joined
    run, begins = windows.run.astype(np.int64), windows.first.astype(np.int64)
    of_force = (np.concatenate(spent), np.concatenate(volume)) if volume else (None, None)
    of_force = of_force if leverage else (None, of_force[1])
    kept = None if products is None else products.kept()
    found = Statistics(hessian, slope, cost, channel, count, rough, pairs, run, begins, *of_force, kept)
    return found, change, follow


def _since_the_last(
    remaining: Tensor, mask: Tensor, rare: Tensor, pair: Tensor, step: Tensor
) -> tuple[Tensor, Tensor]:
    """Return pairs and differences with those of rarely measured channels taken to their last measurement."""
    before = previous(mask)
    seen = mask * (before >= 0)
    gap = (remaining - torch.gather(remaining, 1, before.clamp(min=0))) * seen
    return torch.where(rare, seen[:, 1:], pair), torch.where(rare, gap[:, 1:], step)


def weights_of(sigma: Array) -> Tensor:
    """Return one over the standard deviations, (18,), zero for channels that do not count."""
    return torch.as_tensor(np.where(np.isfinite(sigma), 1.0 / sigma, 0.0))


def cost_of(responses: Iterable[Response], sigma: Array) -> float:
    """Return the weighted squared error of answers, infinite where a model diverged."""
    weight = weights_of(sigma)
    total = sum(_cost(r, weight) for r in responses)
    return total if np.isfinite(total) else np.inf


def _cost(response: Response, weight: Tensor) -> float:
    """Return the weighted squared error, of which a stochastic force takes what it is likely to."""
    return (
        float(((response.error * weight) ** 2).sum())
        if response.force is None
        else cost_with_force(response, weight)
    )


def residual_std(statistics: Statistics, floor: Array, parameters: int) -> Array:
    """Return each channel's root-mean-square error, (18,), for the degrees of freedom spent; infinite unmeasured.

    Args:
        statistics: sums of the windows.
        floor: least value of each channel, (18,), in the channel's unit.
        parameters: how many were fitted to all windows together.
    """
    count = statistics.count.sum(0)
    spent = (12 * len(statistics.cost) + parameters) * count / max(count.sum(), 1.0)
    if statistics.spent is not None:
        spent = statistics.spent.sum(0) + parameters * count / max(count.sum(), 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.sqrt(statistics.channel.sum(0) / np.maximum(count - spent, 0.25 * count))
    return np.where(count > 0, np.maximum(value, floor), np.inf)
