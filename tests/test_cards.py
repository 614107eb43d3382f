"""What objects say about themselves: one short line, a small card that nothing in a log can break out of, a figure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from matplotlib.figure import Figure

import auvnn
from auvnn.cards import Card, Text, measured, not_needed, still_beaten
from auvnn.errors import ConfigError, InputError
from auvnn.models import as_log, as_model


@pytest.fixture(scope="module")
def model():
    return auvnn.load("rov95")


@pytest.fixture(scope="module")
def made(model):
    hidden = {"ocean_current": {"v_north": 0.2, "v_east": -0.1}}
    return auvnn.simulate(
        model, "multisine", "realistic", hidden, 3, runs=2, duration=12.0, rate=10.0, max_step=0.05
    )


@pytest.fixture(scope="module")
def comparison(model, made):
    return auvnn.compare(model, made.log, horizons=("1", "5"))


def test_a_card_is_one_line_of_text_and_html_that_a_name_cannot_break():
    card = Card("a <b>title</b>", "x" * 500, ["<script>alert(1)</script>"], ["<i>"], [["<img src=x>", "1"]])
    assert "\n" not in card.text() and len(card.text()) < 200
    assert "<script>" not in card.markup() and "<img" not in card.markup() and "&lt;img" in card.markup()


def test_a_value_has_as_many_digits_as_its_deviation_deserves():
    assert measured(0.123456, 0.0123, "m/s") == ("0.123 ± 0.012 m/s", "0.099 to 0.148 m/s")
    assert measured(2.0, None, "1") == ("2", "") and measured(None, 1.0, "N")[0] == "unknown N"


def test_logs_are_containers_of_runs_and_columns(made):
    log = made.log
    assert len(log) == 2 and log[0] is log.runs[0] and list(log) == list(log.runs) and log[-1].number == 1
    assert log[1:].runs == log.runs[1:]
    np.testing.assert_array_equal(log["u"], np.concatenate([r.nu[:, 0] for r in log.runs]))
    np.testing.assert_array_equal(log["psi"][: log[0].samples], log[0].euler[:, 2])
    assert log["run"].tolist() == [0] * log[0].samples + [1] * log[1].samples
    assert "u" in log and "run" in log and "nothing" not in log and log[0] in log
    with pytest.raises(InputError, match="Did you mean 'u'"):
        log["uu"]
    with pytest.raises(IndexError):
        log[7]


def test_everything_says_itself_shortly_and_draws_itself(model, made, comparison):
    better = model.with_effects({"ocean_current": {"v_north": 0.2}})
    better.effect("ocean_current").uncertainty = {"v_north": 0.01}
    for shown in (made.log, made.log.quality(), model, better, comparison):
        assert len(repr(shown)) < 200 and "\n" not in repr(shown) and "array(" not in repr(shown)
        assert shown._repr_html_().startswith("<div") and len(shown._repr_html_()) < 8000
        figure = shown.plot()
        assert isinstance(figure, Figure) and figure.axes
    assert "0.200 ± 0.010 m/s" in better._repr_html_() and "0.180 to 0.220" in better._repr_html_()
    assert len(repr(made.log[0])) < 200 and len(repr(model.vehicle)) < 200


def test_answers_of_the_fits_say_themselves(model, made):
    diagnosis = auvnn.diagnose(model, made, ["ocean_current", "net_buoyancy"], costs=False, whiteness=False)
    assert "ocean_current" in repr(diagnosis) and "v_north" in diagnosis._repr_html_()
    better = auvnn.add(model, made, diagnosis.missing, horizons=("5",))
    assert "accepted" in repr(better) and "95 % interval" in better._repr_html_()
    for answer in (diagnosis, better):
        assert isinstance(answer.plot(), Figure) and len(repr(answer)) < 200
    own = {
        "a": {"gain": {"value": 0.1, "std": 0.01}, "accepted": True},
        "b": {"gain": {"value": 0.0, "std": 0.01}},
    }
    idle = replace(
        better,
        gain={"value": 0.1, "std": 0.01},
        by_effect={k: {"accepted": False, **v} for k, v in own.items()},
    )
    assert "b adds nothing to what the others bring: leave it out" in idle._repr_html_()
    line = {**better.baseline, "total": 0.5 * better.baseline["model"]["total"]}
    beaten = replace(better, baseline=line)
    assert "a plain regression" in beaten._repr_html_() and "still predict" in beaten._repr_html_()
    assert "still predict" not in better._repr_html_()
    # What was fitted says how sure it is, also of the model that is handed on.
    assert "±" in better.model._repr_html_()


def test_several_models_on_one_log(model, made, comparison, tmp_path):
    better = model.with_effects({"ocean_current": {"v_north": 0.2, "v_east": -0.1}})
    several = auvnn.compare([model, better, "bluerov2_heavy"], made.log, horizons=("1", "5"))
    assert several.models == ["rov95", "rov95 + ocean_current", "bluerov2_heavy"]
    assert several.ranking[0] == "rov95 + ocean_current" and several.horizon == "5"
    # Each is what it is by itself.
    assert several["rov95"].to_dict() == comparison.to_dict()
    several.write(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "bluerov2_heavy" in page and page.count("<svg") >= 1
    data = several.to_dict()
    assert data["schema"] == "auvnn/comparisons/1" and list(data["comparisons"]) == data["models"]
    named = auvnn.compare({"a": model, "b": better}, made.log, horizons=("1",))
    assert named.models == ["a", "b"] and isinstance(named.plot(), Figure)
    twice = auvnn.compare([model, model], made.log, horizons=("1",))
    assert twice.models == ["rov95", "rov95 (2)"]
    with pytest.raises(InputError, match=r"model rov90: .* 6 thrusters"):
        auvnn.compare([model, "rov90"], made.log, horizons=("1",))
    with pytest.raises(ConfigError, match="no model"):
        auvnn.compare([], made.log)


def test_the_noise_floor_is_below_the_error_and_reached_by_the_truth(made, comparison):
    truth = auvnn.compare(made.plant, made.log, horizons=("5",)).rollout["5"]
    five = comparison.rollout["5"]
    assert five["noise_floor"] < 0.3 * five["total"]
    assert truth["total"] == pytest.approx(truth["noise_floor"], rel=0.3)


def test_names_paths_and_tables_go_where_models_and_logs_go(made, tmp_path, comparison):
    path = made.log.write(tmp_path / "dive.parquet")
    by_path = auvnn.compare("rov95", path, horizons=("1", "5"))
    assert by_path.rollout == comparison.rollout
    table = {name: made.log[name] for name in made.log.columns}
    assert as_log(table)[0].samples == made.log[0].samples and as_log(made) is made.log
    assert as_model(auvnn.load("rov95").vehicle).vehicle.name == "rov95"
    for wrong in (3, None, np.zeros((5, 2))):
        with pytest.raises(ConfigError, match="from_dataframe"):
            as_log(wrong)
    with pytest.raises(ConfigError, match=r"auvnn\.load"):
        as_model(3)
    assert auvnn.resid is auvnn.compare and auvnn.advice is auvnn.check


def test_a_log_of_float32_is_read_as_it_is(made):
    table = {name: made.log[name].astype(np.float32) for name in made.log.columns if name != "run"}
    log = auvnn.Log.from_dataframe({**table, "run": made.log["run"]})
    np.testing.assert_allclose(log["u"], made.log["u"], atol=1e-6)
    tensors = auvnn.Log.from_dataframe({n: torch.as_tensor(v) for n, v in table.items()})
    np.testing.assert_array_equal(tensors["u"], log["u"])


@pytest.mark.parametrize("kind", [np.float64, np.float32, list, torch.float32])
def test_a_model_takes_arrays_lists_and_less_precise_tensors(model, kind):
    generator = np.random.default_rng(0)
    exact = [generator.normal(size=n) * 0.1 for n in (6, 6, model.actuators.size)]
    wanted = model(*map(torch.tensor, exact))

    def given(x):
        if kind is list:
            return x.tolist()
        return torch.tensor(x, dtype=kind) if isinstance(kind, torch.dtype) else x.astype(kind)

    found = model(*map(given, exact))
    assert found.dtype == torch.float64
    torch.testing.assert_close(found, wanted, rtol=1e-4, atol=1e-5)
    times = np.arange(5) * 0.1
    run = model.rollout(given(exact[0]), given(exact[1]), np.tile(exact[2], (5, 1)), given(times))
    assert run.nu.dtype == torch.float64
    assert model.linearise(given(np.concatenate(exact[:2])), given(exact[2])).A.dtype == torch.float64


def test_the_slope_goes_through_a_less_precise_input(model):
    nu = torch.full((6,), 0.1, dtype=torch.float32, requires_grad=True)
    model(torch.zeros(6), nu, torch.zeros(model.actuators.size)).sum().backward()
    assert nu.grad is not None and nu.grad.dtype == torch.float32 and bool((nu.grad != 0).any())


def test_what_is_more_precise_than_the_model_or_no_number_says_how_to_convert():
    small = auvnn.load("rov95").float()
    zero, command = torch.zeros(6), torch.zeros(small.actuators.size)
    with pytest.raises(ConfigError, match=r"nu\.float\(\)"):
        small(zero, zero.double(), command)
    with pytest.raises(ConfigError, match="eta holds no numbers"):
        small(["a"] * 6, zero, command)
    assert small(np.zeros(6), np.zeros(6), command).dtype == torch.float32


def test_text_shows_itself_without_quotes():
    assert repr(Text("a\nb")) == "a\nb"


def test_a_simulation_and_a_free_run_are_one_line_too(model, made):
    assert "array(" not in repr(made) and len(repr(made)) < 200
    assert "ocean_current" in repr(made) and "v_east" in made._repr_html_()
    run = model.rollout([0.0] * 6, [0.0] * 6, np.zeros((11, 8)), np.arange(11) * 0.05)
    assert (
        repr(run) == "<Trajectory: 11 rows over 0.5 s; no divergence>" and "tensor(" not in run._repr_html_()
    )


def test_a_run_that_is_not_there_is_named(made):
    with pytest.raises(IndexError, match="has no run at place 99: it has 2, at 0 to 1"):
        made.log[99]


def test_a_neutral_vehicle_is_called_neutral(model):
    """10 kg times 9.81 m/s2 is 98.1 N but for the last digit."""
    v = replace(model.vehicle, mass=10.0, gravity=9.81, buoyancy=98.1)
    assert v.weight != v.buoyancy and "+0 N, neutral" in v.summary()


@pytest.mark.parametrize(
    ("fall", "bring", "words"),
    [
        (0.1, {"a": 0.1, "b": 0.1}, ""),
        (0.1, {"a": 0.1, "b": 0.002}, "b adds nothing to what the others bring: leave it out"),
        (0.1, {"a": 0.1, "b": -0.002}, "b adds nothing to what the others bring: leave it out"),
        (0.1, {"a": 0.1, "b": -0.05}, "b makes the prediction worse: leave it out"),
        # Two that do not add may be two names of one thing: one of them is left out, not both.
        (0.1, {"a": 0.0, "b": 0.0}, "a, b do not add to what the others bring: leave one of them out"),
        (0.1, {"a": 0.1, "b": None}, "what b would add to the others could not be judged"),
        (0.1, {"a": 0.1, "b": float("nan")}, "what b would add to the others could not be judged"),
        (0.005, {"a": 0.1, "b": 0.0}, ""),
        (None, {"a": 0.1, "b": 0.0}, ""),
    ],
)
def test_an_effect_that_does_not_add_is_told_where_all_together_lower_the_error(fall, bring, words):
    own = {
        name: {"gain": {"value": value, "std": 0.01}, "accepted": value is not None and value > 0.01}
        for name, value in bring.items()
    }
    assert not_needed({"value": fall, "std": 0.01}, own) == words


@pytest.mark.parametrize(
    ("own", "regression", "held", "words"),
    [
        (0.2, 0.3, 0.9, ""),
        # About as good: no more than a twentieth above it.
        (0.2, 0.195, 0.9, ""),
        (0.2, 0.1, 0.9, "a plain regression (0.1) still predicts better than this model (0.2)"),
        (
            7.7,
            0.93,
            0.46,
            "a plain regression (0.93) and holding the initial velocity (0.46) still predict better",
        ),
        (0.5, None, 0.4, "holding the initial velocity (0.4) still predicts better"),
        (0.5, float("nan"), float("nan"), ""),
        # One that diverges has no finite error.
        (float("inf"), 0.9, 1.0, "still predict better than this model, which diverges: more"),
        (float("nan"), 0.9, 1.0, "still predict better than this model, which diverges: more"),
    ],
)
def test_a_model_that_needs_none_still_beats_is_told(own, regression, held, words):
    line = {"model": {"total": own}, "total": regression, "persistence": {"total": held}}
    said = still_beaten(line)
    assert words in said and bool(said) == bool(words)
    assert not words or "auvnn improve" in said


@pytest.mark.parametrize(
    "line", [None, {}, {"total": 0.1}, {"total": 0.1, "model": None, "persistence": None}]
)
def test_nothing_is_told_where_nothing_was_compared(line):
    assert still_beaten(line) == ""
