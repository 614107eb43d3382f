"""The key under which compiled code is kept: the same for copies, another one wherever something else was compiled."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import nn

from auvnn.models import GreyBox
from auvnn.models.identity import Identity
from tests.small_logs import small_vehicle


def model():
    return GreyBox(small_vehicle()).with_effects({"ocean_current": {"v_north": 0.2}, "added_mass": None})


def test_a_copy_has_the_key_of_what_it_was_copied_from():
    own = model()
    copy = own.rebuilt(own.copied_effects())
    with torch.no_grad():
        copy.effect("ocean_current").theta.fill_(0.5)
    assert Identity(copy).key == Identity(own).key


def test_what_a_frozen_record_holds_counts_by_value():
    own = model()
    copy = own.rebuilt(own.copied_effects())
    effect = copy.members[0]
    first, *others = effect.parameters_of
    effect.parameters_of = (replace(first, low=first.low - 1.0), *others)
    assert Identity(copy).key != Identity(own).key
    effect.parameters_of = (replace(first, probes=(0.3,)), *others)
    assert Identity(copy).key != Identity(own).key
    effect.parameters_of = (replace(first), *others)
    assert Identity(copy).key == Identity(own).key


def test_which_part_stands_where_counts():
    class Whole(nn.Module):
        def __init__(self, turned: bool) -> None:
            super().__init__()
            self.one, self.two = nn.Tanh(), nn.Tanh()
            self.order = [self.two, self.one] if turned else [self.one, self.two]

    assert Identity(Whole(False)).key == Identity(Whole(False)).key
    assert Identity(Whole(False)).key != Identity(Whole(True)).key


def test_other_effects_and_another_vehicle_have_other_keys():
    own = model()
    less = own.rebuilt(own.copied_effects()[:1])
    other = GreyBox(small_vehicle(mass=61.0), own.copied_effects())
    assert len({Identity(m).key for m in (own, less, other)}) == 3
