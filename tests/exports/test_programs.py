"""torch.export and ONNX: run by others than the model, batches of any size, in both precisions."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.exports import export
from auvnn.exports.onnx import _atan2
from auvnn.exports.system import System
from tests.exports.cases import OTHERS, VEHICLES, differs, model

TOLERANCE = {"double": 1e-12, "float": 1e-5}


def expected(system, a):
    with torch.no_grad():
        return {
            "rate": system.flow.rate(a["x"], a["u"], a["t"]), "step": system.steps.step(a["s"], a["u"], a["t"], a["h"])
        }  # fmt: skip


def some(names, quick):
    return [n if n in quick else pytest.param(n, marks=pytest.mark.long) for n in names]


@pytest.mark.parametrize("precision", some(TOLERANCE, ["double"]))
@pytest.mark.parametrize("name", some([*VEHICLES, *OTHERS], ["rov90"]))
def test_torch_programs_are_the_model(tmp_path, name, precision):
    own = model(name)
    out = export(own, "torch", tmp_path / "out", precision=precision)
    assert out.lost == () and len(out.files) == 2
    system = System(own, 0.05)
    kind = torch.float64 if precision == "double" else torch.float32
    a = system.samples(1000, seed=21)
    for function, arguments in (("rate", "xut"), ("step", "suth")):
        program = torch.export.load(tmp_path / "out" / f"{system.name}_{function}.pt2").module()
        with torch.no_grad():
            found = program(*(a[n].to(kind) for n in arguments))
            one = program(*(a[n][:1].to(kind) for n in arguments))
        assert differs(found, expected(system, a)[function]) < TOLERANCE[precision]
        assert one.shape == (1, found.shape[1])


@pytest.mark.long
@pytest.mark.parametrize("precision", TOLERANCE)
@pytest.mark.parametrize("name", [*VEHICLES, *OTHERS])
def test_onnx_graphs_are_the_model(tmp_path, name, precision):
    runtime = pytest.importorskip("onnxruntime")
    pytest.importorskip("onnxscript")
    own = model(name)
    out = export(own, "onnx", tmp_path / "out", precision=precision)
    assert out.lost == () and len(out.files) == 2
    system = System(own, 0.05)
    a = system.samples(1000, seed=21)
    for function, arguments in (("rate", "xut"), ("step", "suth")):
        session = runtime.InferenceSession(str(tmp_path / "out" / f"{system.name}_{function}.onnx"))
        wanted = {i.name for i in session.get_inputs()}
        kind = np.float64 if precision == "double" else np.float32
        found = session.run(None, {n: a[n].numpy().astype(kind) for n in arguments if n in wanted})[0]
        assert differs(found, expected(system, a)[function]) < TOLERANCE[precision]


def test_the_angle_of_a_vector_without_the_runtimes_arctangent():
    generator = torch.Generator().manual_seed(0)
    y, x = torch.randn(2, 5000, generator=generator, dtype=torch.float64)
    y[:1000] *= 1e-8
    x[500:1500] *= 1e-8
    special = torch.tensor([0.0, 1.0, -1.0], dtype=torch.float64)
    y, x = torch.cat([y, special.repeat(3)]), torch.cat([x, special.repeat_interleave(3)])
    assert float((_atan2(y, x) - torch.atan2(y, x)).abs().max()) < 4e-15
