"""The FMU: what an independent importer finds wrong with it, and where it goes in ten seconds."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest
import torch

from auvnn.compiled import toolchain
from auvnn.exports import export
from auvnn.models import Inputs
from tests.exports.cases import LAG, OVER, model

fmpy = pytest.importorskip("fmpy")
from fmpy.fmi3 import FMU3Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

# Delays of whole steps, as an actuator's clock has them.
CASES = {
    "rov90": lambda: model("rov90"),
    "remus100": lambda: model("remus100"),
    "networks": lambda: model("networks"),
    "lag": lambda: model("bluerov2").with_effects({**LAG, **OVER}),
    "delay": lambda: model("bluerov2").with_effects({**LAG, "actuation_delay": {"delay": 0.13}}),
}


@pytest.mark.parametrize("name", CASES)
def test_it_is_valid_and_follows_a_rollout(tmp_path, name):
    if toolchain.compiler() is None:
        pytest.skip("no C compiler")
    own, dt = CASES[name](), 0.05
    out = export(own, "fmu", tmp_path / "out", dt=dt)
    assert out.lost == ()
    path = tmp_path / "out" / next(f for f in out.files if f.endswith(".fmu"))
    assert validate_fmu(str(path)) == []
    rows = 201
    commands = np.repeat(
        np.random.default_rng(0).uniform(-0.5, 0.5, (rows // 25 + 1, len(out.inputs))), 25, axis=0
    )[:rows]
    n = own.actuators.size
    commands[:, n:] *= 0.3
    if own.actuation == "wrench":
        commands[:, :6] *= [60, 60, 60, 8, 8, 8]
    fins = torch.tensor(commands[:, n:]) if own.vehicle.fins else None
    eta, nu = torch.tensor([0.0, 0, 10, 0, 0, 0], dtype=torch.float64), torch.zeros(6, dtype=torch.float64)
    times = dt * torch.arange(rows, dtype=torch.float64)
    run = own.rollout(eta, nu, Inputs(torch.tensor(commands[:, :n]), fins), times, engine="torch")
    expected = torch.cat([run.eta, run.nu], dim=-1).detach().numpy()
    description = fmpy.read_model_description(str(path))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    states, inputs = ([reference[x] for x in names] for names in (out.states[:13], out.inputs))
    slave = FMU3Slave(
        guid=description.instantiationToken, unzipDirectory=fmpy.extract(str(path), str(tmp_path / "open")),
        modelIdentifier=description.coSimulation.modelIdentifier, instanceName="one",
    )  # fmt: skip
    slave.instantiate()
    slave.setFloat64(inputs, list(commands[0]))
    slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    found = [slave.getFloat64(states)]
    for k in range(rows - 1):
        slave.setFloat64(inputs, list(commands[k]))
        slave.doStep(k * dt, dt)
        found.append(slave.getFloat64(states))
    slave.terminate()
    slave.freeInstance()
    assert np.abs(np.array(found) - expected).max() < 1e-6
    assert (description.modelExchange is None) == (name == "delay")


def test_model_exchange_with_a_solver_of_the_importer(tmp_path):
    if toolchain.compiler() is None:
        pytest.skip("no C compiler")
    own = model("rov95")
    out = export(own, "fmu", tmp_path / "out")
    path = str(tmp_path / "out" / out.files[0])
    push = np.array(
        [(0.0, 40.0, 10.0), (6.0, 40.0, 10.0)], dtype=[("time", float), ("tau_X", float), ("tau_N", float)]
    )
    own = own if own.actuation == "wrench" else None
    if own is None:
        push = np.array([(0.0, 0.4), (6.0, 0.4)], dtype=[("time", float), ("thruster_1", float)])
        own = model("rov95")
    found = fmpy.simulate_fmu(
        path, fmi_type="ModelExchange", stop_time=5.0, relative_tolerance=1e-9, input=push, output=list(out.states[:13])
    )  # fmt: skip
    command = torch.zeros(101, own.actuators.size, dtype=torch.float64)
    for name in push.dtype.names[1:]:
        command[:, out.inputs.index(name)] = float(push[name][0])
    run = own.rollout(
        torch.tensor([0.0, 0, 10, 0, 0, 0], dtype=torch.float64), torch.zeros(6, dtype=torch.float64), command,
        0.05 * torch.arange(101, dtype=torch.float64), max_step=0.01, engine="torch",
    )  # fmt: skip
    expected = torch.cat([run.eta[-1], run.nu[-1]]).detach().numpy()
    assert np.abs(np.array(list(found[-1])[1:14]) - expected).max() < 1e-5


def test_it_carries_its_sources_and_is_the_same_each_time(tmp_path, monkeypatch):
    monkeypatch.setenv("AUVNN_CC", "none")
    for folder in ("a", "b"):
        out = export(model("rov90"), "fmu", tmp_path / folder)
    assert any("sources alone" in note for note in out.notes)
    with zipfile.ZipFile(tmp_path / "a" / "rov90.fmu") as archive:
        names = set(archive.namelist())
    assert names == {
        "modelDescription.xml", "sources/buildDescription.xml", "sources/fmu.c", "sources/rov90.c", "sources/rov90.h"
    }  # fmt: skip
    assert (tmp_path / "a" / "rov90.fmu").read_bytes() == (tmp_path / "b" / "rov90.fmu").read_bytes()
