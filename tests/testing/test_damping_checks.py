"""The contract checks of damping forms catch what they are there to catch."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from auvnn.damping.base import DampingForm
from auvnn.testing import DAMPING_CHECKS, check_damping_form


class Cubic(DampingForm):
    """d_i = c_i nu_i^3: sound, unless a subclass spoils it."""

    name = "cubic"

    def __init__(self, axes, *, slope=0.0):
        super().__init__(axes)
        self.slope = slope
        self.cubic = nn.Parameter(torch.ones(len(self.axes), dtype=torch.float64))

    def options(self):
        return {"slope": self.slope}

    def reset(self, generator):
        with torch.no_grad():
            self.cubic.fill_(1.0)

    def forward(self, nu):
        own = nu[..., list(self.axes)]
        return own * (self.slope + self.cubic * own**2)


class OneForAll(Cubic):
    def forward(self, nu):
        return super().forward(nu).sum(-1)


class AcceptsAnyAxes(Cubic):
    def __init__(self, axes, *, slope=0.0):
        nn.Module.__init__(self)
        self.axes, self.slope = tuple(axes), slope
        self.cubic = nn.Parameter(torch.ones(max(1, len(self.axes)), dtype=torch.float64))


class ForgetsOptions(Cubic):
    def __init__(self, axes, *, slope=2.0):
        super().__init__(axes, slope=slope)
        self.slope = slope if slope != 2.0 else 3.0

    def options(self):
        return {"slope": 2.5}


class JoinsWrongly(Cubic):
    @classmethod
    def joined(cls, forms):
        return super().joined(list(reversed(forms)))


class MixesSamples(Cubic):
    def forward(self, nu):
        return super().forward(nu) * (1 + nu.abs().max())


class AlwaysDouble(Cubic):
    def forward(self, nu):
        return super().forward(nu) * torch.ones(len(self.axes), dtype=torch.float64)


class NeverReset(Cubic):
    def reset(self, generator):
        return None


class RootOfSpeed(Cubic):
    def forward(self, nu):
        return super().forward(nu) + nu[..., list(self.axes)].abs().sqrt()  # its slope at rest is not finite


class LooksAtNumbers(Cubic):
    def forward(self, nu):
        return super().forward(nu) * (2.0 if float(nu.sum()) > 0 else 1.0)


BROKEN = [
    ("states_its_shape", OneForAll), ("refuses_axes", AcceptsAnyAxes), ("rebuilds", ForgetsOptions),
    ("joins", JoinsWrongly), ("batches", MixesSamples), ("follows_precision", AlwaysDouble),
    ("follows_device", AlwaysDouble), ("starts_alike", NeverReset), ("has_right_gradient", RootOfSpeed),
    ("transforms", LooksAtNumbers),
]  # fmt: skip


@pytest.mark.parametrize(("check", "kind"), BROKEN, ids=lambda x: x if isinstance(x, str) else x.__name__)
def test_a_broken_form_is_caught(check, kind):
    with pytest.raises((AssertionError, RuntimeError)):
        DAMPING_CHECKS[check](kind)


def test_every_check_is_known_to_catch_something():
    assert {check for check, _ in BROKEN} == set(DAMPING_CHECKS)


def test_a_sound_form_of_another_author_passes():
    check_damping_form(Cubic)
