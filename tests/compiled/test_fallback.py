"""What cannot be compiled runs in torch and says why; what changed since is not run as it was."""

from __future__ import annotations

import math
import os
import stat

import pytest
import torch

import auvnn
from auvnn.compiled import toolchain
from auvnn.compiled.kernel import LANES
from auvnn.compiled.known_code import KnownCode
from auvnn.damping.bank import DampingBank
from auvnn.effects.base import Effect
from auvnn.effects.hooks import Parameter
from auvnn.errors import ConfigError
from auvnn.models import GreyBox, Inputs, model_kernels
from auvnn.models import engine as engines
from auvnn.vehicle import load_vehicle

DOUBLE = torch.float64


class Strange(Effect):
    """A further force that does what the subclasses like."""

    name = "strange"
    cause = symbol = reference = "made up"

    def __init__(self):
        super().__init__((Parameter("size", "N", 0.0, 1.0, -10.0, 10.0),), {"size": 2.0})

    def wrench(self, moment, body):
        return self.theta[0] * self.pattern(moment)


class Branches(Strange):
    def pattern(self, moment):
        return torch.ones_like(moment.nu) if moment.nu[..., 0].sum() > 0 else -torch.ones_like(moment.nu)


class Rare(Strange):
    def pattern(self, moment):
        return torch.special.bessel_j0(moment.nu)


class Peeks(Strange):
    def pattern(self, moment):
        return torch.ones_like(moment.nu) * sum(moment.nu.detach().reshape(-1).tolist())


class OwnGradient(Strange):
    """Whose gradient is not that of what it computes: autograd's word counts."""

    class Twice(torch.autograd.Function):
        @staticmethod
        def forward(ctx, x):
            return x * 1.0

        @staticmethod
        def backward(ctx, *up):
            return 2.0 * up[0]

    def pattern(self, moment):
        return self.Twice.apply(moment.nu)


class Tuned(Strange):
    factor = 1.0

    def pattern(self, moment):
        return self.factor * moment.nu


def rov(*effects, damping=None):
    return GreyBox(load_vehicle("rov95"), effects, damping, actuation="wrench")


def run(model, engine="compiled", rows=6, **options):
    eta, nu = torch.zeros(6, dtype=DOUBLE), torch.tensor([0.3, 0.1, 0.0, 0.0, 0.1, 0.2], dtype=DOUBLE)
    times = 0.05 * torch.arange(rows, dtype=DOUBLE)
    command = torch.tensor([20.0, 5.0, 1.0, 0.5, 0.2, 1.0], dtype=DOUBLE).expand(rows, 6)
    return model.rollout(eta, nu, command, times, engine=engine, check=False, **options).nu


@pytest.mark.parametrize(
    ("effect", "reason"),
    [(Branches, "control flow"), (Rare, "bessel_j0"), (Peeks, "disagree")],
)
def test_user_effects_that_are_not_covered_say_so(compiler, effect, reason):
    model = rov(effect())
    assert reason in engines.why_not(model, gradient=False)
    with torch.no_grad():
        with pytest.raises(ConfigError, match=reason):
            run(model)
        assert torch.equal(run(model, "auto"), run(model, "torch"))


def test_a_gradient_that_a_user_defined_is_kept(compiler):
    model = rov(OwnGradient())
    slopes = [
        torch.autograd.grad(run(model, e)[-1].sum(), model.effects[0].theta)[0] for e in ("torch", "compiled")
    ]
    assert float((slopes[0] - slopes[1]).abs()) < 1e-10 * float(slopes[0].abs())


def test_a_changed_attribute_is_seen(compiler):
    effect = Tuned()
    model = rov(effect)
    with torch.no_grad():
        first = run(model)
        effect.factor = 3.0
        second = run(model)
        assert not torch.allclose(first, second)
        assert torch.allclose(second, run(model, "torch"), rtol=1e-12, atol=1e-14)


def test_changed_weights_and_buffers_are_seen(compiler):
    model = rov()
    with torch.no_grad():
        run(model)
        # Zeros of buffers are left out of the code: one that is none any more must bring it back.
        assert float(model.known_cg[0]) == 0.0
        model.known_cg[0] = 0.03
        assert torch.allclose(run(model), run(model, "torch"), rtol=1e-12, atol=1e-14)


def test_without_a_compiler_torch_runs(monkeypatch):
    monkeypatch.setenv("AUVNN_CC", "none")
    model = rov()
    assert "no C compiler" in engines.why_not(model)
    with torch.no_grad(), pytest.raises(ConfigError, match="no C compiler"):
        run(model)


def test_a_diagnosis_by_plain_torch_says_so_and_why(monkeypatch):
    """It gives the same names, and takes several times as long: who waits should know that a compiler is missing."""
    model = GreyBox(load_vehicle("rov95"))
    log = auvnn.simulate(
        model, "multisine", "realistic", {"net_buoyancy": {"force": 8.0}}, runs=1, duration=6.0
    ).log
    asked = {"advice": False, "whiteness": False, "stochastic": False, "costs": False}
    monkeypatch.setenv("AUVNN_ENGINE", "auto")
    monkeypatch.setenv("AUVNN_CC", "none")
    monkeypatch.setattr(model_kernels, "_MADE", KnownCode(4))
    found = auvnn.diagnose(model, log, ["net_buoyancy"], **asked)
    assert found.missing == ["net_buoyancy"], found.warnings
    told = [w for w in found.warnings if w.startswith("free running is by plain torch")]
    assert ["no C compiler" in w for w in told] == [True], found.warnings
    # Who asked for torch need not be told.
    inputs = Inputs(torch.zeros(1, model.actuators.size, dtype=DOUBLE))
    assert engines.slower(model, inputs, 2)
    monkeypatch.setenv("AUVNN_ENGINE", "torch")
    assert engines.slower(model, inputs, 2) == []


def test_nothing_is_said_where_it_compiles_and_only_what_will_run_is_compiled(compiler, monkeypatch):
    monkeypatch.setenv("AUVNN_ENGINE", "auto")
    monkeypatch.setattr(model_kernels, "_MADE", KnownCode(4))
    monkeypatch.setattr(model_kernels, "_KERNELS", {})
    model = GreyBox(load_vehicle("rov95"))
    assert engines.slower(model, Inputs(torch.zeros(1, model.actuators.size, dtype=DOUBLE)), 2) == []
    (kernel,) = model_kernels._KERNELS.values()
    # The code for many trajectories is another one than that for one.
    assert list(kernel._loaded) == [LANES]


@pytest.mark.parametrize("single", [True, False])
def test_other_numbers_and_transforms_are_left_to_torch(compiler, single):
    model = rov()
    if single:
        assert "float32" in engines.why_not(model.float())
        return
    times = 0.05 * torch.arange(3, dtype=DOUBLE)
    command = torch.ones(3, 6, dtype=DOUBLE)

    def end(nu):
        eta = torch.zeros(6, dtype=DOUBLE)
        return model.rollout(eta, nu, command, times, engine="compiled", check=False).nu[-1]

    with pytest.raises(ConfigError, match="transform"):
        torch.func.jacrev(end)(torch.zeros(6, dtype=DOUBLE))


def test_hooks_are_left_to_torch(compiler):
    model = rov(damping=DampingBank.from_description("polynomial"))
    model.damping.register_forward_hook(lambda module, given, out: None)
    with torch.no_grad(), pytest.raises(ConfigError, match="hook"):
        run(model)


def test_what_is_trained_only_in_part_has_gradients_only_there(compiler):
    model = rov(damping=DampingBank.from_description("polynomial")).with_effects({"constant_force": None})
    model.damping.requires_grad_(False)
    run(model).sum().backward()
    assert model.damping.forms[0].linear.grad is None
    assert bool(model.effects[0].theta.grad.any())


def test_unknown_engines_are_refused():
    with pytest.raises(ConfigError, match="no engine called"):
        run(rov(), "fortran")


def test_compiled_code_is_kept_privately_and_used_again(compiler, own_cache, monkeypatch):
    model = rov().with_effects({"constant_force": None})
    with torch.no_grad():
        first = run(model)
    kept = sorted(own_cache.glob("*.so"))
    assert kept
    assert not list(own_cache.glob("making-*"))
    assert all(stat.S_IMODE(f.stat().st_mode) == 0o700 for f in kept)
    engines._KERNELS.clear()
    monkeypatch.setattr(toolchain, "_compile", lambda *a: pytest.fail("compiled again"))
    with torch.no_grad():
        again = run(rov().with_effects({"constant_force": None}))
    assert torch.equal(first, again)


def test_a_cache_that_others_can_write_is_refused(compiler, tmp_path, monkeypatch):
    folder = tmp_path / "open"
    folder.mkdir()
    os.chmod(folder, 0o777)
    monkeypatch.setenv("AUVNN_CACHE", str(folder))
    engines._KERNELS.clear()
    assert "make it private" in engines.why_not(rov(), gradient=False)


def test_auto_compiles_only_where_it_pays(compiler, monkeypatch, tmp_path):
    monkeypatch.setenv("AUVNN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("AUVNN_ENGINE", "auto")
    engines._KERNELS.clear()
    monkeypatch.setattr(engines, "COMPILING", {False: 0.2, True: math.inf})
    built = []
    build = toolchain.build
    monkeypatch.setattr(toolchain, "build", lambda *a: built.append(a) or build(*a))
    model = rov()
    with torch.no_grad():
        run(model, "auto")
        assert not built  # a few steps: not worth a thought
        run(model, "auto", rows=1200, max_step=0.05)
        assert len(built) == 1  # 1200 steps: 0.3 s of torch by estimate
        other = rov()
        run(other, "auto", rows=600)
        assert len(built) == 1  # known code, loaded already


class Counts(Strange):
    """Changes a buffer whenever it is asked: code would not."""

    def __init__(self):
        super().__init__()
        self.register_buffer("calls", torch.zeros((), dtype=DOUBLE))

    def pattern(self, moment):
        self.calls += 1.0
        return moment.nu * self.calls


def test_what_changes_itself_is_left_to_torch(compiler):
    assert "changed in place" in engines.why_not(rov(Counts()), gradient=False)


def test_firm_is_the_same_whatever_came_before(compiler, monkeypatch):
    """Short runs that auto would leave to torch; and torch where torch is asked for, or nothing else is possible."""
    monkeypatch.setenv("AUVNN_ENGINE", "auto")
    model = rov()
    with torch.no_grad():
        assert torch.equal(run(model, "firm"), run(model, "compiled"))
        assert not torch.equal(run(model, "firm"), run(model, "torch")), (
            "not by the bits, or this test says nothing"
        )
        strange = rov(Rare())
        assert torch.equal(run(strange, "firm"), run(strange, "torch"))
        monkeypatch.setenv("AUVNN_ENGINE", "torch")
        assert torch.equal(run(model, "firm"), run(model, "torch"))


def test_inference_mode_is_no_hindrance(compiler):
    """There some operations show as wholes, of which the graph has no rule."""
    with torch.inference_mode():
        known = GreyBox(load_vehicle("rov95"))
        nothing = torch.zeros(6, 8, dtype=DOUBLE)
        eta, nu, times = nothing[0, :6], nothing[1, :6], 0.05 * torch.arange(6, dtype=DOUBLE)
        engines._KERNELS.clear()
        # One that has not been traced outside.
        fast = known.rollout(eta, nu + 0.1, nothing + 0.2, times, engine="compiled", check=False).nu
        slow = known.rollout(eta, nu + 0.1, nothing + 0.2, times, engine="torch", check=False).nu
    assert torch.allclose(fast, slow, rtol=1e-12, atol=1e-14)
