"""Rows 79 to 103: models that are no physics, fits that must not be believed, and models on disk."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load as read_tensors
from safetensors.torch import save as tensor_bytes

import auvnn as package
from auvnn.damping.bank import DampingBank
from auvnn.models import GreyBox, load
from tests.faults.vehicles import put

DIAGONAL = [20.0, 30.0, 40.0, 1.0, 1.5, 2.0]


def matrix(diagonal: list[float], **entries: float) -> list[list[float]]:
    """A full matrix with further entries, named by row and column, a04=1."""
    full = np.diag(diagonal)
    for name, value in entries.items():
        full[int(name[1]), int(name[2])] = value
    return full.tolist()


@pytest.mark.parametrize(
    ("added_mass", "parts"),
    [
        (matrix(DIAGONAL, a15=9.0), ["added_mass is not symmetric"]),
        (
            matrix(DIAGONAL, a01=90.0, a10=90.0),
            ["M_RB + M_A is not positive definite", "smallest eigenvalue"],
        ),
    ],
    ids=["not symmetric", "not positive definite"],
)
def test_row_79_an_inertia_that_no_body_has(refused, added_mass, parts):
    line = refused("compare", "log=good.csv", f"model={put('spoilt.yaml', added_mass=added_mass)}")
    for part in parts:
        assert part in line


def test_row_79_no_effect_makes_one(refused):
    """What is fitted is a factor above zero: no value of it can make the inertia indefinite."""
    for value in (-1.0, 0.0):
        spoilt = put("spoilt.yaml", effects={"added_mass": {"X": value}})
        assert "added_mass" in refused("compare", "log=good.csv", f"model={spoilt}")
    lowest = load(put("low.yaml", effects={"added_mass": dict.fromkeys("XYZKMN", 0.05)}))
    assert torch.linalg.eigvalsh(lowest.prepare(None).total).min() > 0.0


@pytest.mark.parametrize("sign", [[-1] * 6, [1, 1, -1, 1, 1, 1]], ids=["all", "one"])
def test_row_80_added_mass_of_the_wrong_sign(refused, sign):
    spoilt = put("spoilt.yaml", added_mass=[s * a for s, a in zip(sign, DIAGONAL, strict=True)])
    line = refused("compare", "log=good.csv", f"model={spoilt}")
    assert "added_mass" in line and "turn" in line


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ({"linear_damping": [-10.0] + [1.0] * 5}, ["linear_damping", "energy in u"]),
        ({"linear_damping": matrix([10.0] * 6, a15=90.0)}, ["linear_damping adds energy", "v=", "r="]),
        (
            {"quadratic_damping": matrix([40.0] * 6, a15=-400.0)},
            ["quadratic_damping adds energy", "v=", "r="],
        ),
    ],
)
def test_row_81_damping_that_adds_energy(refused, change, parts):
    line = refused("compare", "log=good.csv", f"model={put('spoilt.yaml', **change)}")
    for part in parts:
        assert part in line


def test_row_82_buoyancy_below_weight(auvnn):
    spoilt = put("spoilt.yaml", center_of_buoyancy=[0.0, 0.0, 0.1])
    words = "the centre of buoyancy lies 0.07 m below the centre of gravity: the vehicle turns over"
    assert any(words in warning for warning in load(spoilt).vehicle.warnings)
    status, out, _ = auvnn(
        "simulate",
        f"model={spoilt}",
        "noise=none",
        "runs=1",
        "duration=1",
        "max_step=0.1",
        "rate=10",
        "out=out",
    )
    assert status == 0 and f"assumed   {words}" in out


EXPLODING = """
import sys, torch
from dataclasses import replace
from auvnn.damping.bank import DampingBank
from auvnn.models import GreyBox, load
assert False, "not reached under -O"
bank = DampingBank.from_description({"form": "zero", "each": {"X": {"form": "polynomial", "coupled": False}}})
for form in bank.groups():
    if form.name == "polynomial":
        with torch.no_grad():
            form.quadratic.fill_(-400.0)
model = GreyBox(replace(load("four.yaml").vehicle, quadratic_damping=None), damping=bank, actuation="wrench")
nu = torch.tensor([[0.5, 0, 0, 0, 0, 0]], dtype=torch.float64)
t = torch.arange(0, 5, 0.05, dtype=torch.float64)
run = model.rollout(torch.zeros(1, 6).double(), nu, torch.zeros(len(t), 6).double(), t)
print(run.diverged, torch.isfinite(run.nu).all().item())
print(run.divergences[0].words)
"""


def test_row_85_a_diverging_run_ends_in_words_with_assertions_switched_off(home):
    environment = {**os.environ, "PYTHONPATH": str(Path(package.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-O", "-c", EXPLODING],
        cwd=home,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    first, words = done.stdout.strip().split("\n")
    assert first == "True True"
    assert "damping subnetworks" in words and " s" in words


# Models on disk


@pytest.fixture
def saved() -> Path:
    """A model's folder with weights."""
    bank = DampingBank.from_description("mlp", seed=1)
    return GreyBox(load("four.yaml").vehicle, damping=bank).save("saved")


def use(refused, model: object = "saved") -> str:
    return refused("compare", "log=good.csv", f"model={model}")


def forge(folder: Path, name: str, data: bytes) -> None:
    """Write a file and a manifest that vouches for it."""
    import hashlib

    (folder / name).write_bytes(data)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["files"][name] = {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize("name", ["model.yaml", "weights.safetensors", "manifest.json"])
def test_row_97_a_model_that_was_cut_or_changed(refused, saved, name):
    data = (saved / name).read_bytes()
    (saved / name).write_bytes(data[: len(data) // 2])
    assert name in use(refused)
    flipped = bytearray(data)
    flipped[len(data) // 2] ^= 1
    (saved / name).write_bytes(flipped)
    # A manifest has no hash of its own: it then asks for what is not there.
    assert ("saved" if name == "manifest.json" else "SHA-256") in use(refused)


class Bomb:
    def __reduce__(self):
        return (os.mkdir, ("went-off",))


@pytest.mark.parametrize(
    "name", ["model.pt", "model.pkl", "model.safetensors", "model.yaml", "model.zip", "good.csv"]
)
def test_row_98_a_pickle_under_any_name(refused, home, name):
    """And a zip whose contents would fill the disk, and one that begins as a table."""
    Path(name).write_bytes(pickle.dumps(Bomb()))
    if name == "good.csv":
        refused("check", "log=good.csv")
    else:
        use(refused, name)
    with zipfile.ZipFile(name, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("data.pkl", bytes(3_000_000))
    refused("check", "log=good.csv") if name == "good.csv" else use(refused, name)
    assert not Path("went-off").exists()
    assert {p.name for p in home.iterdir()} <= {name, "good.csv", "four.yaml"}


def test_row_98_a_pickle_in_the_place_of_weights(refused, saved):
    forge(saved, "weights.safetensors", pickle.dumps(Bomb()))
    assert "pickle or a zip archive, not safetensors" in use(refused)
    assert not Path("went-off").exists()


def test_row_99_a_model_of_another_auvnn(refused, saved):
    manifest = (saved / "manifest.json").read_text()
    (saved / "manifest.json").write_text(manifest.replace('/1"', '/99"', 1))
    assert "upgrade auvnn" in use(refused)


def test_row_99_weights_that_are_not_those_of_the_model(refused, saved):
    tensors = read_tensors((saved / "weights.safetensors").read_bytes())
    first, second, *_ = tensors
    shape = tuple(tensors[second].shape)
    del tensors[first]
    tensors[second] = torch.zeros((*shape, 2), dtype=torch.float32)
    tensors["stranger"] = torch.zeros(1)
    forge(saved, "weights.safetensors", tensor_bytes(tensors))
    line = use(refused)
    for part in (
        f"{first} is missing",
        "stranger is not known here",
        f"{second} has shape {(*shape, 2)} instead of",
    ):
        assert part in line


def test_row_99_effects_that_this_auvnn_does_not_know(refused, saved):
    from auvnn.config import dump_yaml, parse_yaml

    data = parse_yaml((saved / "model.yaml").read_text(), "model.yaml")
    data["effects"] = {"ocean_curent": {"v_north": 0.1}}
    forge(saved, "model.yaml", dump_yaml(data).encode())
    line = use(refused)
    assert "'ocean_curent'" in line and "'ocean_current'" in line


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_row_100_weights_that_are_no_numbers(refused, saved, value):
    tensors = read_tensors((saved / "weights.safetensors").read_bytes())
    name = next(iter(tensors))
    tensors[name].view(-1)[0] = value
    forge(saved, "weights.safetensors", tensor_bytes(tensors))
    assert f"{name} holds NaN or infinity" in use(refused)
    Path("nan.yaml").write_text(Path("four.yaml").read_text().replace("mass: 50.0", "mass: .nan"))
    assert "mass is nan" in use(refused, "nan.yaml")


def test_row_101_a_saved_model_replaced_by_a_run_that_is_killed(auvnn, saved, monkeypatch):
    """Through the verb that saves one: the old folder is what it was."""
    before = {p.name: p.read_bytes() for p in saved.iterdir()}
    put("effect.yaml", effects={"net_buoyancy": {"force": 3.0}})
    assert auvnn("remove", "model=effect.yaml", "effect=net_buoyancy", "out=kept")[0] == 0
    kept = {p: p.read_bytes() for p in Path("kept").rglob("*") if p.is_file()}

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    for name in ("fsync", "replace"):
        with monkeypatch.context() as patch:
            patch.setattr(os, name, killed)
            with pytest.raises(KeyboardInterrupt):
                load("four.yaml").save("saved", overwrite=True)
            status, _, err = auvnn(
                "remove", "model=effect.yaml", "effect=net_buoyancy", "out=kept", "overwrite=true"
            )
        assert status == 130 and err.count("\n") == 1
        assert {p.name: p.read_bytes() for p in saved.iterdir()} == before
        assert {p: p.read_bytes() for p in Path("kept").rglob("*") if p.is_file()} == kept
    load("saved")


def test_row_102_a_training_resumed_on_other_data(auvnn, refused, good):
    """The command line's own: same options, another log; only force goes on."""
    from auvnn.cli.speech import Speaker

    lines = good.strip().split("\n")
    lines[200] = lines[200].replace(lines[200].split(",")[5], "0.123", 1)
    Path("other.csv").write_text("\n".join(lines) + "\n")
    words = ["train", "model=four.yaml", "scheme=sgd", "scheme.epochs=40", "out=out"]

    def interrupt(self: Speaker, said: str) -> None:
        if "iteration 20" in said:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Speaker, "progress", interrupt)
        assert auvnn(*words, "log=good.csv")[0] == 130
    line = refused(*words, "log=other.csv", "resume=true")
    assert "data" in line and "force" in line
    line = refused(*words, "log=good.csv", "scheme.learning_rate=0.7", "resume=true")
    assert "learning_rate" in line
