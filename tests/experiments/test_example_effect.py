"""The example package is found by its entry point, as an installed one would be, and keeps the contract."""

from __future__ import annotations

import importlib
import sys
import tomllib
from pathlib import Path

import pytest
import torch

from auvnn.catalogue import Catalogue
from auvnn.effects import EFFECTS
from auvnn.models import GreyBox
from auvnn.testing import EFFECT_CHECKS, plain_vehicle
from auvnn.vehicle import load_vehicle

FOLDER = Path(__file__).parents[2] / "experiments" / "example_effect"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Put the package's source and a dist-info with its entry points on the path; return the catalogue that sees it."""
    project = tomllib.loads((FOLDER / "pyproject.toml").read_text())["project"]
    info = tmp_path / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    points = project["entry-points"]["auvnn.effects"]
    lines = ["[auvnn.effects]", *(f"{name} = {value}" for name, value in points.items())]
    # An outsider's effect must not take the place of one of ours.
    lines.append("ocean_current = auvnn_example_effect.parachute:Parachute")
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(str(FOLDER / "src"))
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    monkeypatch.setattr(EFFECTS, "_outside", None)
    yield EFFECTS
    for name in [n for n in sys.modules if n.startswith("auvnn_example_effect")]:
        monkeypatch.delitem(sys.modules, name)


def test_the_catalogue_offers_it_after_its_own(installed):
    assert installed.names()[-1] == "parachute" and "parachute" in installed
    kind = installed.get("parachute")
    assert kind.name == "parachute" and kind.__module__ == "auvnn_example_effect.parachute"
    assert installed.get("ocean_current").__module__ == "auvnn.effects.ocean_current"


def test_a_model_takes_it_by_name_and_keeps_it(installed, tmp_path):
    from auvnn.models import load

    model = GreyBox(load_vehicle("rov95")).with_effects({"parachute": {"drag": 30.0}})
    model.save(tmp_path / "model")
    assert load(tmp_path / "model").effect("parachute").values()["drag"] == 30.0


def test_diagnosis_has_it_among_its_candidates(installed):
    from auvnn.diagnosis.hypotheses.candidates import candidates_for
    from auvnn.models import load
    from auvnn.simulation import simulate

    model = load("rov95")
    log = simulate(model, "paper", runs=1, duration=2.0, rate=10.0, max_step=0.1, noise="none").log
    assert "parachute" in candidates_for(model, log, None)[0]


@pytest.mark.parametrize("check", EFFECT_CHECKS)
def test_it_passes_the_checks_that_are_shipped(installed, check):
    EFFECT_CHECKS[check](installed.get("parachute"))


def test_its_own_closed_form(installed):
    kind = installed.get("parachute")
    model = GreyBox(
        plain_vehicle(), [kind.build(plain_vehicle(), "wrench", {"drag": 35.0})], actuation="wrench"
    )
    times = torch.linspace(0, 5, 51, dtype=torch.float64)
    start = torch.tensor([0.8, 0, 0, 0, 0, 0], dtype=torch.float64)
    run = model.rollout(torch.zeros(6).double(), start, torch.zeros(51, 6).double(), times)
    torch.testing.assert_close(run.nu[:, 0], 0.8 / (1 + 35 * 0.8 * times / 70), rtol=1e-6, atol=0)


def test_without_the_package_there_is_no_such_effect():
    assert "parachute" not in Catalogue("effect", {}, "auvnn.effects").names()
