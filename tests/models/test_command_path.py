"""How commands go between samples, as a model states it: read, refused, saved, and carried over."""

from __future__ import annotations

import pytest
import yaml

from auvnn.errors import ModelError
from auvnn.models import GreyBox, load, remove
from auvnn.models.actuation.command_path import CommandPath, with_commands
from auvnn.models.structures import build_structure
from tests.small_logs import small_vehicle

LINE = CommandPath("linear", 0.5, 0.2)
CUBIC = CommandPath("smooth", 0.47, 0.1, interpolated="thrust")
MEAN = CommandPath("averaged", 0.5, 0.05, samples=8)


@pytest.mark.parametrize("path", [LINE, CUBIC, MEAN])
def test_it_is_read_as_it_was_written(path, tmp_path):
    assert CommandPath.read(path.to_dict(), "here") == path
    model = with_commands(GreyBox(small_vehicle()), path)
    back = load(model.save(tmp_path / "m"))
    assert back.commands == path
    told = yaml.safe_load((tmp_path / "m/model.yaml").read_text())["commands"]
    assert told["between_samples"] == path.between_samples and told["interval"] == path.interval


def test_a_model_without_a_statement_writes_none(tmp_path):
    model = GreyBox(small_vehicle())
    assert model.commands is None
    model.save(tmp_path / "m")
    assert "commands" not in yaml.safe_load((tmp_path / "m/model.yaml").read_text())
    assert load(tmp_path / "m").commands is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"between_samples": "held"}, "choose linear, ahead, smooth, averaged"),
        ({"between_samples": 3}, "between_samples is 3"),
        ({"share_of_next": 1.2}, "share_of_next is 1.2"),
        ({"share_of_next": True}, "share_of_next is True"),
        ({"share_of_next": float("nan")}, "share_of_next is nan"),
        ({"interval": 0.0}, "interval is 0.0"),
        ({"interval": "0.2"}, "interval is '0.2'"),
        ({"samples": 4}, "samples is 4"),
        ({"between_samples": "averaged", "samples": 3}, "samples is 3"),
        ({"between_samples": "averaged", "samples": 1000}, "samples is 1000"),
        ({"between_samples": "averaged"}, "samples is 0"),
        ({"interpolated": "torque"}, "interpolated is 'torque'"),
        ({"colour": 1}, "may have 'samples'"),
    ],
)
def test_what_makes_no_sense_is_refused(change, words):
    with pytest.raises(ModelError, match=words):
        CommandPath.read({**LINE.to_dict(), **change}, "file")
    for missing in ("between_samples", "share_of_next", "interval"):
        with pytest.raises(ModelError, match="needs"):
            CommandPath.read({k: v for k, v in LINE.to_dict().items() if k != missing}, "file")
    with pytest.raises(ModelError, match="needs"):
        CommandPath.read(["linear"], "file")


def test_it_counts_for_logs_with_about_the_same_interval():
    assert [LINE.counts_at(x) for x in (0.2, 0.17, 0.23, 0.16, 0.25, 0.05, 0.0)] == [
        True, True, True, False, False, False, False,
    ]  # fmt: skip


def test_models_made_from_one_that_states_it_state_it_too():
    model = with_commands(GreyBox(small_vehicle()), LINE)
    added = model.with_effects({"net_buoyancy": {"force": 2.0}})
    made = [
        added, added.rebuilt(added.copied_effects()), added.sharing(added.members), remove(added, "net_buoyancy"),
        model.with_effects(["net_buoyancy"]).without_absent(), added.extended_by(),
    ]  # fmt: skip
    assert [m.commands for m in made] == [LINE] * len(made)
    structured = build_structure("separate", small_vehicle(), effects=(), actuation=model.actuation)
    assert with_commands(structured, CUBIC).sharing([]).commands == CUBIC


def test_another_statement_leaves_the_model_as_it_was():
    model = with_commands(GreyBox(small_vehicle()).with_effects({"net_buoyancy": {"force": 2.0}}), LINE)
    other = with_commands(model, None)
    assert other.commands is None and model.commands == LINE
    assert other.effects[0] is model.effects[0]


def test_it_is_said_in_words():
    assert "as 50% of its own sample's and 50% of the next one's" in LINE.words()
    assert "cubic through the thrusts of four samples, -0.03 of an interval" in CUBIC.words()
    assert "average of 8 samples" in MEAN.words() and "mean command" in MEAN.words()
