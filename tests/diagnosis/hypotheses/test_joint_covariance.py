"""Fitted effects enter a later diagnosis with their whole covariance: against dense linear algebra, and through files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.stats import multivariate_normal

from auvnn.config import dump_yaml, parse_yaml
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis, left_out, log_evidence
from auvnn.diagnosis.hypotheses.put_into_model import with_fitted_parameters
from auvnn.diagnosis.hypotheses.stated_priors import SINGULAR, lay_out, priors
from auvnn.errors import ModelError
from auvnn.estimation.prediction_error import Fitted
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox, load, remove
from auvnn.models.joint_covariance import JointCovariance
from auvnn.models.loading import from_contents
from auvnn.models.saving import contents
from tests.diagnosis.linear_world import World
from tests.small_logs import make_log, small_vehicle

BOTH = ["net_buoyancy", "constant_force"]
LABELS = ("net_buoyancy.force", "constant_force.X", "constant_force.Z")
STD = np.array([2.0, 0.5, 2.1])
CORRELATION = np.array([[1.0, 0.2, -0.98], [0.2, 1.0, -0.1], [-0.98, -0.1, 1.0]])


def known(vehicle=None):
    """Return a model with two effects that were fitted together."""
    model = GreyBox(vehicle or small_vehicle()).with_effects(
        {"net_buoyancy": {"force": 3.0}, "constant_force": {"X": 1.0, "Z": -1.0}}
    )
    model.effect("net_buoyancy").state_uncertainty({"force": 2.0})
    model.effect("constant_force").state_uncertainty({"X": 0.5, "Z": 2.1})
    model.joint = JointCovariance(LABELS, CORRELATION * np.outer(STD, STD))
    return model


def columns_of(layout, names, labels=LABELS):
    every = [f"{n}.{p.name}" for n in names for p in layout.described(n)]
    return [every.index(x) for x in labels]


def test_priors_have_the_saved_covariance_and_are_independent_of_all_else():
    layout = lay_out(known(), ["ocean_current"])
    names = ["added_mass", *BOTH, "ocean_current"]
    held = priors(layout, names, ["ocean_current"])
    at = columns_of(layout, names)
    covariance = np.linalg.inv(held.square)
    np.testing.assert_allclose(covariance[np.ix_(at, at)], CORRELATION * np.outer(STD, STD), rtol=1e-5)
    others = np.setdiff1d(np.arange(len(covariance)), at)
    assert not covariance[np.ix_(at, others)].any()
    np.testing.assert_allclose(np.diag(covariance)[others], 1.0 / held.precision[others])
    # One of them alone is as uncertain as its margin; what is asked for is known of no more.
    alone = priors(layout, ["net_buoyancy"])
    assert alone.joint is None and alone.precision == pytest.approx([0.25])
    assert priors(layout, BOTH, ["net_buoyancy"]).square[0, 1:].tolist() == [0.0] * 6


def dense(world, errors, names):
    """Return the fit that dense least squares gives."""
    columns = world.layout.of(names)
    held = priors(world.layout, names)
    flat = world.jacobian.reshape(-1, world.jacobian.shape[-1])[:, columns]
    step = np.linalg.solve(flat.T @ flat + held.square, flat.T @ errors.ravel())
    theta, everything = world.means[columns] + step, world.means.copy()
    everything[columns] = theta
    sums = world.statistics(errors, everything).columns(columns)
    sigma = np.where(np.arange(18) == 6, 1.0, np.inf)
    fit = Fitted(
        world.layout.model, tuple(names), theta, torch.zeros(len(errors), 13), sigma, sums, held, 0.0, True, 1
    )
    none = np.zeros(len(errors))
    return FittedHypothesis((), fit, tuple(names), 0.0, none, none), flat


def test_evidence_and_what_is_left_out_are_those_of_the_joint_normal():
    world = World.random(lay_out(known(), []), windows=12, samples=6, strength=6.0, runs=3)
    names = list(dict.fromkeys([*world.layout.nuisance, *BOTH]))
    found = []
    for seed in (0, 1):
        random = np.random.default_rng(seed)
        errors = world.errors(world.means, random)
        explanation, flat = dense(world, errors, names)
        held = explanation.fitted.priors
        covariance = np.linalg.inv(held.square)
        density = multivariate_normal(np.zeros(errors.size), np.eye(errors.size) + flat @ covariance @ flat.T)
        wanted = density.logpdf(errors.ravel()) + 0.5 * errors.size * np.log(2 * np.pi)
        assert log_evidence(world.layout, explanation, 1.0).evidence == pytest.approx(wanted, abs=1e-6)
        found.append(wanted)
        fold = world.run
        cost = left_out(explanation.fitted.statistics, explanation.fitted.theta, held, fold)
        columns = world.layout.of(names)
        for f in range(3):
            j = world.jacobian[fold != f][..., columns].reshape(-1, len(columns))
            step = np.linalg.solve(j.T @ j + held.square, j.T @ errors[fold != f].ravel())
            left = errors[fold == f] - world.jacobian[fold == f][..., columns] @ step
            np.testing.assert_allclose(cost[fold == f], (left**2).sum(1), rtol=1e-6)
    assert found[0] != found[1]


@pytest.fixture(scope="module")
def first():
    """Return a model fitted to log A, in which two vertical forces can hardly be told apart."""
    bare = GreyBox(small_vehicle(uncertainty=0.02))
    truth = bare.with_effects({"net_buoyancy": {"force": 4.0}, "constant_force": {"Z": 2.0}})
    log = make_log(truth, runs=1, duration=20.0, noise=1.0, seed=1, size=0.3)
    windows = cut_windows(log, 5.0, kind=bare.actuation, partial=True)
    layout = lay_out(bare, BOTH)
    found = fit_hypothesis(layout, windows, layout.nuisance, BOTH)
    return with_fitted_parameters(bare, layout, found), found, layout


@pytest.mark.long
def test_a_second_log_updates_the_first_fit_as_bayes_has_it(first, tmp_path):
    fitted, found, layout = first
    model = load(fitted.save(tmp_path / "model"))
    assert model.joint is not None and model.joint.parameters == fitted.joint.parameters
    np.testing.assert_array_equal(model.joint.matrix, fitted.joint.matrix)
    labels = list(model.joint.parameters)
    # The saved one is the fit's own, at standard errors that the windows' scatter has made wider.
    at = columns_of(layout, found.names, labels)
    own = found.fitted.covariance()[np.ix_(at, at)]
    spread = np.sqrt(np.diag(own))
    saved = np.sqrt(np.diag(model.joint.matrix))
    np.testing.assert_allclose(
        model.joint.matrix / np.outer(saved, saved), own / np.outer(spread, spread), atol=1e-9
    )
    pair = [labels.index("net_buoyancy.force"), labels.index("constant_force.Z")]
    assert abs(model.joint.matrix[pair[0], pair[1]] / np.prod(saved[pair])) > 0.8

    # On log B the truth is elsewhere along the direction that log A left open.
    value, direction = np.linalg.eigh(model.joint.matrix[np.ix_(pair, pair)])
    shift = 2.0 * np.sqrt(value[1]) * direction[:, 1]
    truth = remove(model, BOTH).with_effects(
        {
            "net_buoyancy": {"force": model.effect("net_buoyancy").values()["force"] + shift[0]},
            "constant_force": {"Z": model.effect("constant_force").values()["Z"] + shift[1]},
        }
    )
    log = make_log(truth, runs=1, duration=12.0, noise=1.0, seed=2, size=0.6)
    windows = cut_windows(log, 5.0, kind=model.actuation, partial=True)
    results = []
    for joint in (model.joint, None):
        at_hand = lay_out(model, [])
        at_hand = replace(at_hand, joint=joint)
        names = [*at_hand.nuisance, *BOTH]
        again = fit_hypothesis(at_hand, windows, names, (), iterations=30).fitted
        # The update in closed form, from the windows' sums and the saved matrix alone.
        precision = np.diag(again.priors.precision)
        if joint is not None:
            inside = columns_of(at_hand, names, labels)
            block = joint.matrix + SINGULAR * (np.diag(np.diag(joint.matrix)) - joint.matrix)
            precision[np.ix_(inside, inside)] = np.linalg.inv(block)
        information = again.statistics.total
        pull = again.statistics.slope.sum(0) + information @ (again.theta - again.priors.mean)
        wanted = again.priors.mean + np.linalg.solve(information + precision, pull)
        posterior = np.linalg.inv(information + precision)
        std = np.sqrt(np.diag(posterior))
        assert np.abs((again.theta - wanted) / std).max() < 0.05
        np.testing.assert_allclose(again.covariance(), posterior, rtol=1e-6, atol=1e-9 * posterior.max())
        here = columns_of(at_hand, names, [labels[k] for k in pair])
        moved = direction.T @ (again.theta - again.priors.mean)[here]
        left = np.sqrt(np.diag(direction.T @ posterior[np.ix_(here, here)] @ direction))
        results.append((np.abs(moved) / np.sqrt(value), left / np.sqrt(value)))
    (moved, left), (_, loose) = results
    # Across, it stays within what log A said; without the covariance that would have been forgotten.
    assert moved[0] < 3.0 and left[0] <= 1.0 + 1e-6
    assert loose[0] > 1.2 * left[0]


def test_the_covariance_goes_with_its_effects():
    model = known()
    assert model.with_effects(["ocean_current"]).joint.parameters == LABELS
    left = remove(model, "constant_force").joint
    assert left.parameters == ("net_buoyancy.force",) and left.matrix.tolist() == [[4.0]]
    assert remove(model, BOTH).joint is None
    assert GreyBox(small_vehicle()).joint is None


def changed(**entries):
    model = known()
    data = parse_yaml(contents(model, Path("here"))["model.yaml"], "here")
    data["covariance"] = {**data["covariance"], **entries}
    return {"model.yaml": dump_yaml(data, "here").encode()}


def test_a_covariance_that_is_one_is_read(tmp_path):
    again = from_contents(changed(), tmp_path)
    assert again.joint.parameters == LABELS
    np.testing.assert_array_equal(again.joint.matrix, known().joint.matrix)


MATRIX = (CORRELATION * np.outer(STD, STD)).tolist()


@pytest.mark.parametrize(("entries", "words"), [
    ({"matrix": [[4.0, 0.0], [0.0, 1.0]]}, r"is \(2, 2\), not \(3, 3\)"),
    ({"matrix": [[4.0, 0.0, 0.1], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "not symmetric"),
    ({"matrix": [[4.0, 0.0, 4.0], [0.0, 1.0, 0.0], [4.0, 0.0, 1.0]]}, "not positive semi-definite"),
    ({"matrix": [[4.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]}, "not positive semi-definite"),
    ({"matrix": [[4.0, 0.0, 0.0], [0.0, float("nan"), 0.0], [0.0, 0.0, 1.0]]}, "NaN or infinity"),
    ({"matrix": "much"}, "no matrix of numbers"),
    ({"matrix": [[1.0], [1.0, 2.0], [3.0]]}, "no matrix of numbers"),
    ({"parameters": ["net_buoyancy.force", "net_buoyancy.force", "constant_force.Z"]}, "twice"),
    ({"parameters": ["waves.amplitude", "constant_force.X", "constant_force.Z"]}, "waves.amplitude, which is no"),
    ({"parameters": 3}, "no list of names"),
    ({"more": 1}, "'parameters' and 'matrix', and nothing else"),
])  # fmt: skip
def test_what_is_no_covariance_of_the_models_effects_is_refused_in_one_line(entries, words, tmp_path):
    files = changed(**entries)
    with pytest.raises(ModelError, match=words) as refused:
        from_contents(files, tmp_path)
    assert "\n" not in str(refused.value) and "model.yaml" in str(refused.value)
