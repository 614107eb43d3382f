"""What an export answers, and what it refuses."""

from __future__ import annotations

import json

import pytest

import auvnn
from auvnn.errors import ConfigError, InputError
from auvnn.exports import TARGETS, export
from auvnn.exports.base import Target
from auvnn.exports.system import identifier
from tests.exports.cases import model


def test_the_answer_says_what_was_written(tmp_path):
    own = model("rov90").with_effects({"velocity_scale": {"factor": 1.05}, "actuation_delay": {"delay": 0.1}})
    out = auvnn.export(own, to="c", out=tmp_path / "out", dt=0.1, name="my_rov")
    told = json.loads((tmp_path / "out" / "export.json").read_text())
    assert told == out.to_dict() and told["schema"] == "auvnn/export/1"
    assert told["files"] == ["my_rov.c", "my_rov.h", "my_rov_test.c"]
    assert told["lost"] == [
        "velocity_scale: what sensors make of the state is no part of the equations of motion"
    ]
    assert any("exact in steps of 0.1 s" in note for note in told["notes"])
    n = own.actuators.size
    assert len(told["states"]) == 13 + 3 * n and len(told["step_states"]) == 13 + n
    assert max(told["agreement"].values()) < 1e-12
    with pytest.raises(ConfigError, match="velocity_scale"):
        auvnn.export(own, to="c", out=tmp_path / "strict", strict=True)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"to": "fortran"}, "no export target called 'fortran'"),
        ({"to": "fmu", "precision": "float"}, "to=fmu knows double"),
        ({"to": "c", "dt": -1.0}, "give a positive step"),
        ({"to": "c", "name": "9 lives"}, "letters, digits and _"),
        ({"to": "c", "name": "while"}, "letters, digits and _"),
    ],
)
def test_what_cannot_be_is_refused_and_leaves_nothing(tmp_path, options, words):
    with pytest.raises(ConfigError, match=words):
        export(model("rov90"), out=tmp_path / "out", **options)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_unless_asked(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("kept")
    with pytest.raises(InputError, match="not an empty folder"):
        export(model("rov90"), "sdf", tmp_path / "out")
    export(model("rov90"), "sdf", tmp_path / "out", overwrite=True)
    assert (tmp_path / "out" / "mine.txt").read_text() == "kept" and (tmp_path / "out" / "model.sdf").exists()


def test_names_of_vehicles_become_names_in_code():
    assert identifier("My ROV (2)") == "My_ROV_2"
    assert identifier("7 seas") == "model_7_seas"
    assert identifier("möwe") == "m_we"


@pytest.mark.parametrize("name", TARGETS.names())
def test_every_target_says_what_it_is(name):
    target = TARGETS.get(name)
    assert issubclass(target, Target) and target.name == name and target.summary
