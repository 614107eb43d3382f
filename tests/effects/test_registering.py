"""Effects of one's own at run time: named, added, hidden, saved and loaded like any other."""

from __future__ import annotations

import pytest
import torch

import auvnn
from auvnn.effects import EFFECTS, Effect, Parameter
from auvnn.effects.registering import name_of, names_of, values_of
from auvnn.errors import ConfigError

pytestmark = pytest.mark.usefixtures("catalogue_as_before")


def net_drag(name: str = "net_drag") -> type[Effect]:
    """Return a separate class each time, as a notebook's cell does that runs again."""

    class NetDrag(Effect):
        """A net that is towed: X = -drag |u_r| u_r."""

        cause = "a net that is towed"

        @classmethod
        def describe(cls, vehicle, actuation):
            return (Parameter("drag", "N s2/m2", 0.0, 50.0, 0.0, 1000.0),)

        def wrench(self, moment, body):
            u = moment.nu_r[..., :1]
            return torch.nn.functional.pad(-self.value("drag") * u.abs() * u, (0, 5))

    NetDrag.name = name
    return NetDrag


def test_a_class_goes_wherever_a_name_goes(tmp_path):
    kind, model = net_drag(), auvnn.load("rov95")
    hidden = kind.build(model.vehicle, model.actuation, {"drag": 400.0})
    made = auvnn.simulate(
        model, "multisine", "realistic", hidden, 1, runs=2, duration=16.0, rate=10.0, max_step=0.05
    )
    assert made.truth["hidden"] == {"net_drag": {"drag": 400.0}}
    options = {"costs": False, "whiteness": False, "advice": False}
    found = auvnn.diagnose(model, made, [kind, "ocean_current"], **options)
    assert found.missing == ["net_drag"]
    better = auvnn.add(model, made, kind, horizons=("5",))
    fitted = better.parameters["net_drag"]["drag"]
    assert abs(fitted["value"] - 400.0) < 4 * fitted["std"]
    better.model.save(tmp_path / "better")
    assert auvnn.load(tmp_path / "better").effect_names == ["net_drag"]
    assert auvnn.remove(better.model, kind).effect_names == []
    assert "net_drag" in EFFECTS.names()


def test_it_can_be_registered_by_itself_and_again():
    kind = auvnn.register_effect(net_drag())
    assert EFFECTS.get("net_drag") is kind and kind.symbol == "net_drag" and kind.reference
    again = auvnn.register_effect(net_drag())
    assert EFFECTS.get("net_drag") is again and EFFECTS.names().count("net_drag") == 1


def test_names_classes_and_instances_are_the_same():
    kind, model = net_drag(), auvnn.load("rov95")
    member = kind.build(model.vehicle, "thrusters", {"drag": 3.0})
    assert name_of("waves") == "waves" and name_of(kind) == name_of(member) == "net_drag"
    assert (
        names_of([kind, "waves"]) == ["net_drag", "waves"]
        and names_of(None) is None
        and names_of(kind) == "net_drag"
    )
    assert values_of([member, "waves"]) == {"net_drag": {"drag": 3.0}, "waves": None}
    assert values_of({kind: {"drag": 1.0}}) == {"net_drag": {"drag": 1.0}} and values_of("waves") == {
        "waves": None
    }
    assert model.with_effects([member]).effect("net_drag").values() == {"drag": 3.0}


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (int, "no effect"),
        (3, "no effect"),
        (type("Nameless", (Effect,), {}), "has no name"),
        (type("Causeless", (Effect,), {"name": "causeless"}), "has no cause"),
        (type("Idle", (Effect,), {"name": "idle", "cause": "nothing"}), "overrides no hook"),
        (net_drag("ocean_current"), "in the catalogue already"),
        (net_drag("two words"), "letters, digits"),
    ],
)
def test_what_is_no_effect_is_refused_in_one_line(kind, words):
    with pytest.raises(ConfigError, match=words) as refused:
        auvnn.register_effect(kind)
    assert "\n" not in str(refused.value)
