"""What every damping form promises, as functions of its class."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.func import functional_call, jacfwd, jacrev, vmap

from auvnn.config import dump_yaml, parse_yaml
from auvnn.damping.base import DampingForm
from auvnn.errors import ConfigError
from auvnn.testing.scene import require, require_close

Kind = type[DampingForm]
AXES = (4, 0, 3)


def _made(kind: Kind, axes: tuple[int, ...] = AXES, seed: int = 2) -> DampingForm:
    """Return the form with parameters that are neither at their start nor zero."""
    form, make = kind(axes), torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in form.parameters():
            parameter.add_(0.3 * torch.randn(parameter.shape, generator=make, dtype=torch.float64))
    return form


def _velocities(*shape: int, seed: int = 5) -> Tensor:
    return torch.randn(*shape, 6, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def states_its_shape(kind: Kind) -> None:
    """Check the name, the shape of the answer, and that parameters and buffers have the axes first."""
    require(bool(getattr(kind, "name", "")) and kind.name.isidentifier(), "the form has no name")
    form = _made(kind)
    for shape in ((), (1,), (4,), (2, 3), (0,)):
        answer = form(_velocities(*shape))
        require(
            answer.shape == (*shape, len(AXES)), f"{kind.name}: {tuple(answer.shape)} for velocities {shape}"
        )
    for name, tensor in form.state_dict().items():
        require(
            tensor.shape[:1] == (len(AXES),), f"{kind.name}: {name} does not have the axes as first dimension"
        )


def refuses_axes(kind: Kind) -> None:
    """Check that no axes, repeated ones and unknown ones are refused."""
    for axes in ((), (0, 0), (6,), (-1,)):
        try:
            kind(axes)
        except ConfigError:
            continue
        raise AssertionError(f"{kind.name} accepted the axes {axes}")


def rebuilds(kind: Kind) -> None:
    """Check that options, as plain data, and the state dict bring back the same law to the last bit."""
    form, nu = _made(kind), _velocities(7)
    told = parse_yaml(dump_yaml(form.describe()), kind.name)
    require(told.pop("form") == kind.name, f"{kind.name}: describe() does not say its name")
    fresh = kind(AXES, **told)
    fresh.load_state_dict(form.state_dict())
    require(torch.equal(fresh(nu), form(nu)), f"{kind.name}: a rebuilt form answers otherwise")


def joins(kind: Kind) -> None:
    """Check that forms of single axes, joined, answer as they do alone."""
    nu = _velocities(7)
    single = [_made(kind, (axis,), seed=axis) for axis in AXES]
    whole = kind.joined(single)
    require(whole.axes == AXES, f"{kind.name}: joined for the axes {whole.axes} instead of {AXES}")
    require_close(whole(nu), torch.cat([form(nu) for form in single], dim=-1), 1e-14, f"{kind.name}: joined")


def batches(kind: Kind) -> None:
    """Check that a batch gives what its members give one by one."""
    form, nu = _made(kind), _velocities(5)
    require_close(torch.stack([form(one) for one in nu]), form(nu), 1e-14, f"{kind.name}: one by one")


def follows_precision(kind: Kind) -> None:
    """Check that single precision stays single and is close to double."""
    form, nu = _made(kind), _velocities(5)
    exact, rounded = form(nu), _made(kind).float()(nu.float())
    require(exact.dtype == torch.float64, f"{kind.name}: double precision became {exact.dtype}")
    require(rounded.dtype == torch.float32, f"{kind.name}: single precision became {rounded.dtype}")
    require_close(rounded, exact, 1e-4, f"{kind.name} in single precision")


def follows_device(kind: Kind, device: str = "meta") -> None:
    """Check that no tensor is left on another device; "meta" needs no hardware."""
    answer = _made(kind).to(device)(_velocities(5).to(device))
    require(answer.device.type == device, f"{kind.name} answers on {answer.device} instead of {device}")


def starts_alike(kind: Kind) -> None:
    """Check that the same seed gives the same initial parameters, whatever they were before."""
    forms = [kind(AXES), _made(kind)]
    for form in forms:
        form.reset(torch.Generator().manual_seed(11))
    for (name, a), b in zip(forms[0].state_dict().items(), forms[1].state_dict().values(), strict=True):
        require(torch.equal(a, b), f"{kind.name}: {name} depends on more than the seed")


def has_right_gradient(kind: Kind) -> None:
    """Check the derivatives in velocity and parameters, and that they are finite at rest and far out."""
    form, nu = _made(kind), _velocities(3).requires_grad_()
    torch.autograd.gradcheck(form, (nu,), eps=1e-6, rtol=1e-5, atol=1e-7)
    names = [name for name, _ in form.named_parameters()]
    values = [value.detach().clone().requires_grad_() for _, value in form.named_parameters()]
    if values:
        torch.autograd.gradcheck(
            lambda *x: functional_call(form, dict(zip(names, x, strict=True)), (nu.detach(),)),
            tuple(values),
            eps=1e-6,
            rtol=1e-5,
            atol=1e-7,
        )
    for where in (torch.zeros(6, dtype=torch.float64), 1e3 * _velocities(4)):
        point = where.clone().requires_grad_()
        answer = form(point)
        slopes = torch.autograd.grad(
            answer.sum() + 0 * point.sum(), [point, *form.parameters()], allow_unused=True
        )
        for tensor in (answer, *(slope for slope in slopes if slope is not None)):
            require(bool(torch.isfinite(tensor).all()), f"{kind.name}: not finite at rest or at great speed")


def transforms(kind: Kind) -> None:
    """Check that `torch.func` sees through it: jacrev = jacfwd, vmap = batch."""
    form, nu = _made(kind), _velocities(4)
    require_close(vmap(form)(nu), form(nu), 1e-14, f"{kind.name}: vmap against a batch")
    require_close(
        vmap(jacrev(form))(nu), vmap(jacfwd(form))(nu), 1e-12, f"{kind.name}: jacrev against jacfwd"
    )


DAMPING_CHECKS: dict[str, Callable[..., None]] = {
    check.__name__: check
    for check in (
        states_its_shape,
        refuses_axes,
        rebuilds,
        joins,
        batches,
        follows_precision,
        follows_device,
        starts_alike,
        has_right_gradient,
        transforms,
    )
}


def check_damping_form(kind: Kind) -> None:
    """Run all checks on a damping form's class.

    Raises:
        AssertionError: a promise is broken; the message says which.
    """
    for check in DAMPING_CHECKS.values():
        check(kind)
