"""Explanations that a log cannot tell apart: which of them are told together."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from auvnn.diagnosis.noise_law.hypothesis import tied
from tests.diagnosis.noise_law.stand_ins import hypothesis

COLUMNS: Any = SimpleNamespace(
    columns={
        "added_mass": range(6),
        "trapped_water": range(1),
        "net_buoyancy": range(1),
        "thruster_lag": range(8),
        "tether": range(10),
        "quadratic_damping": range(6),
        "fin_drag": range(2),
        "compressibility": range(1),
    }
)


def names_of(good, before=10000.0):
    return [h.name for h in tied(COLUMNS, good, hypothesis("", before))]


def test_what_is_known_to_be_confused_and_explains_nearly_as_much_is_tied():
    best, other = hypothesis("added_mass", 5000.0), hypothesis("trapped_water", 5200.0)
    # One mass is plainer than six factors.
    assert names_of([best, other]) == ["trapped_water", "added_mass"]
    # Beyond a tenth of the gain it is refuted; and what is not known to be confused is refuted much earlier.
    assert names_of([best, hypothesis("trapped_water", 5600.0)]) == ["added_mass"]
    assert names_of([best, hypothesis("net_buoyancy", 5200.0)]) == ["added_mass"]
    assert names_of([best, hypothesis("net_buoyancy", 5000.5)]) == ["added_mass", "net_buoyancy"]


def test_drag_is_plainer_than_a_cable_that_is_dragged_along():
    best = hypothesis("tether", 5000.0)
    assert names_of([best, hypothesis("fin_drag", 5200.0)]) == ["tether", "fin_drag"]
    assert names_of([best, hypothesis("fin_drag", 5200.0), hypothesis("quadratic_damping", 5300.0)]) == [
        "quadratic_damping",
        "tether",
        "fin_drag",
    ]
    assert names_of([best, hypothesis("net_buoyancy", 5200.0)]) == ["net_buoyancy", "tether"]
    # So is buoyancy that falls with depth, which the weight of a long cable looks like.
    assert names_of([best, hypothesis("compressibility", 5200.0)]) == ["compressibility", "tether"]


def test_what_is_as_likely_and_known_to_be_confused_is_tied_however_much_more_parameters_fit():
    best = hypothesis("added_mass", 5000.0, -2600.0)
    # Worse by more than a tenth of the gain, and as likely for its fewer parameters.
    assert names_of([best, hypothesis("trapped_water", 5600.0, -2604.0)]) == ["trapped_water", "added_mass"]
    assert names_of([best, hypothesis("trapped_water", 5600.0, -2605.0)]) == ["added_mass"]
    assert names_of([best, hypothesis("net_buoyancy", 5600.0, -2604.0)]) == ["added_mass"]


def test_the_nearly_as_good_do_not_make_a_group_too_large():
    good = [hypothesis("added_mass", 5000.0), hypothesis("net_buoyancy", 5000.5)]
    assert names_of([*good, hypothesis("trapped_water", 5100.0), hypothesis("thruster_lag", 5150.0)]) == [
        "trapped_water",
        "added_mass",
        "net_buoyancy",
    ]


THRUST: Any = SimpleNamespace(
    columns={
        n: range(1) for n in ("thruster_gain", "thrust_asymmetry", "thrust_inflow_loss", "voltage_droop")
    }
)


def test_of_more_that_are_alike_than_a_group_holds_the_plainest_of_all_and_the_best_are_told():
    good = [hypothesis(n, 5000.0 + 0.1 * k) for k, n in enumerate(THRUST.columns)]

    def said(order):
        return [h.name for h in tied(THRUST, [good[k] for k in order], hypothesis("", 10000.0))]

    # A gain of the thrust is plainer than each of the others.
    assert said([0, 1, 2, 3]) == ["thruster_gain", "thrust_asymmetry", "thrust_inflow_loss"]
    good[0], good[3] = hypothesis("thruster_gain", 5000.3), hypothesis("voltage_droop", 5000.0)
    assert said([3, 1, 2, 0]) == ["thruster_gain", "voltage_droop", "thrust_asymmetry"]
    # Of the others none is: a group that is too large is returned whole, and none of it is given.
    columns: Any = SimpleNamespace(columns={**THRUST.columns, "munk_moment": range(1)})
    others = [*good[1:], hypothesis("munk_moment", 5000.2)]
    assert len(tied(columns, others, hypothesis("", 10000.0))) == 4
