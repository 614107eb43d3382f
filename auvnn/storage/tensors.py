"""Named tensors as safetensors bytes, checked on their way out and on their way in."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from auvnn.errors import ModelError


def tensors_to_bytes(tensors: Mapping[str, Tensor], *, finite: bool = True) -> bytes:
    """Return named tensors as safetensors bytes.

    Args:
        tensors: names and tensors.
        finite: refuse NaN and infinity.

    Raises:
        ModelError: a tensor is not finite.
    """
    from safetensors.torch import save

    bad = [name for name, tensor in tensors.items() if finite and not _is_finite(tensor)]
    if bad:
        raise ModelError(
            f"weights are NaN or infinite in {', '.join(bad)}: not saved; train again from the last good"
        )
    plain = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    data = save(plain)
    again = tensors_from_bytes(data, finite=False)
    if again.keys() != plain.keys() or not all(_same(again[name], plain[name]) for name in plain):
        raise ModelError(
            "weights cannot be read back as they are: not saved; please report this with the model"
        )
    return data


def tensors_from_bytes(
    data: bytes,
    expected: Mapping[str, tuple[tuple[int, ...], torch.dtype]] | None = None,
    *,
    where: str = "weights",
    finite: bool = True,
) -> dict[str, Tensor]:
    """Return the named tensors in safetensors bytes, after checking them.

    Args:
        data: the bytes of a safetensors file.
        expected: name to (shape, dtype) of exactly the tensors that must be there; None takes any.
        where: what is read, for messages.
        finite: refuse NaN and infinity.

    Raises:
        ModelError: not safetensors, or tensors missing, extra, of another shape or dtype, or not finite; the
            message lists every difference.
    """
    from safetensors import SafetensorError
    from safetensors.torch import load

    try:
        tensors = load(data)
    except (SafetensorError, KeyError, ValueError, RuntimeError) as error:
        # Only now: a safetensors file begins with a length, whose first byte may be that of a pickle by chance.
        if data[:1] == b"\x80" or data[:2] == b"PK":
            raise ModelError(
                f"{where}: this is a pickle or a zip archive, not safetensors: auvnn does not open those"
            ) from None
        raise ModelError(f"{where}: not a readable safetensors file ({error}): make it again") from error
    wrong = [] if expected is None else _differences(tensors, expected)
    if finite:
        wrong += [
            f"{name} holds NaN or infinity" for name, tensor in tensors.items() if not _is_finite(tensor)
        ]
    if wrong:
        raise ModelError(f"{where}: {'; '.join(wrong)}")
    return tensors


def _differences(
    tensors: Mapping[str, Tensor], expected: Mapping[str, tuple[tuple[int, ...], torch.dtype]]
) -> list[str]:
    wrong = [f"{name} is missing" for name in expected if name not in tensors]
    wrong += [f"{name} is not known here" for name in tensors if name not in expected]
    for name, (shape, dtype) in expected.items():
        if name in tensors and tuple(tensors[name].shape) != tuple(shape):
            wrong.append(f"{name} has shape {tuple(tensors[name].shape)} instead of {tuple(shape)}")
        if name in tensors and tensors[name].dtype != dtype:
            wrong.append(f"{name} is {tensors[name].dtype} instead of {dtype}")
    return wrong


def _same(a: Tensor, b: Tensor) -> bool:
    """Say whether two tensors hold the same bits."""
    alike = a.dtype == b.dtype and a.shape == b.shape
    if not alike or a.numel() == 0:
        return alike
    return torch.equal(a.reshape(-1).view(torch.uint8), b.reshape(-1).view(torch.uint8))


def _is_finite(tensor: Tensor) -> bool:
    return not tensor.is_floating_point() or bool(torch.isfinite(tensor).all())
