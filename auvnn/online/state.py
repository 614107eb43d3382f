"""An adapter on disk: whole or absent, without pickle, so that a restart goes on bit for bit.

One folder holds the model's description, every tensor (safetensors) and the plain rest (JSON), with the SHA-256 of
each. It is staged beside its place and moved there in one step: a loss of power leaves the old state or the new
one, never half of an update.
"""

from __future__ import annotations

import copy
import json
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from auvnn.errors import AuvnnError, ModelError
from auvnn.models.loading import from_contents
from auvnn.models.saving import MODEL, contents
from auvnn.online.change_detection.change import Monitor
from auvnn.online.counts import Counts
from auvnn.online.guards import Guards
from auvnn.online.residual import Sample
from auvnn.storage import read_folder, tensors_from_bytes, tensors_to_bytes, write_folder

if TYPE_CHECKING:
    from auvnn.models import GreyBox
    from auvnn.online.adapter import Adapter

SCHEMA = "auvnn/adapter/1"
PLAIN, TENSORS = "adapter.json", "adapter.safetensors"
_VECTORS = ("eta", "nu", "command", "nu_dot", "fins", "voltage", "altitude")


def save(adapter: Adapter, folder: str | Path) -> Path:
    """Write an adapter's state into a folder, replacing a former state there in one step."""
    path = Path(folder)
    files = contents(adapter._model, path)
    files[TENSORS] = tensors_to_bytes(_tensors(adapter), finite=False)
    files[PLAIN] = json.dumps(_plain(adapter), indent=1, sort_keys=True)
    return write_folder(
        path, files, overwrite=True, schema=SCHEMA, readable=lambda found: _parts(found, path)
    )


def restore(kind: type[Adapter], folder: str | Path, *, validated: bool = False) -> Adapter:
    """Return the adapter that `save` wrote.

    Args:
        kind: the class to build.
        folder: where it is.
        validated: begin from the last validated weights, which drops updates that were still being judged.

    Raises:
        InputError: there is no such folder.
        ModelError: it is damaged, incomplete, or of another kind.
    """
    path = Path(folder)
    adapter = _restored(kind, read_folder(path, schema=SCHEMA), path)
    if validated:
        adapter.weights.write(adapter._shadow.valid)
        adapter.scheme.load(adapter._shadow.scheme_state)
        adapter._shadow.close()
    return adapter


def _restored(kind: type[Adapter], files: Mapping[str, bytes], path: Path) -> Adapter:
    tensors, plain, model = _parts(files, path)
    try:
        watched = plain["monitor"]
        adapter = kind(
            model,
            plain["scheme"],
            guards=Guards(**plain["guards"]),
            watch=False,
        )
        adapter._original.bank.load_state_dict(_part(tensors, "original"))
        adapter._original.bank.passive = plain["passive"]
        adapter.scheme.load(_part(tensors, "scheme"))
        adapter._shadow.load(_part(tensors, "shadow"))
        adapter._trial.load(_part(tensors, "trial"))
        adapter._noise.load(_part(tensors, "noise"))
        adapter._bounds.load(_part(tensors, "bounds"), adapter.weights)
        adapter._gate.load(plain["gate"])
        adapter.counts = Counts(**plain["counts"])
        adapter.paused, adapter.added = plain["paused"], plain["added"]
        adapter._debt, adapter._resting = plain["debt"], plain["resting"]
        off = plain["off_until"]
        adapter._off_until = -float("inf") if off is None else off
        predictor = adapter._predictor
        samples = [_sample(tensors, f"history.{k}") for k in range(plain["history"])]
        predictor.history = deque(samples, maxlen=predictor.history.maxlen)
        if watched is not None:
            adapter._monitor = Monitor(adapter._unadapted(), adapter.weights.bank.output_scale)
            filling = [_sample(tensors, f"pending.{k}") for k in range(watched["pending"])]
            adapter._monitor.load(watched, _part(tensors, "monitor"), filling)
        adapter._held = [
            (_sample(tensors, f"held.{k}"), tensors[f"held.{k}.nu"], tensors[f"held.{k}.missing"])
            for k in range(plain["held"])
        ]
        adapter._consistency.load(_part(tensors, "consistency"))
        adapter._positions.load(_part(tensors, "positions"))
        adapter._trusted.load(_part(tensors, "trusted"))
        # States that were saved before these were kept have the older ones alone.
        recent = _part(tensors, "recent")
        adapter._recent.load(recent if recent else _part(tensors, "trusted"))
        adapter._steps.load(_part(tensors, "steps"))
        adapter._off_cause = plain["off_cause"]
        predictor._last = _sample(tensors, "last") if plain["last"] else None
    except AuvnnError:
        raise
    except (KeyError, TypeError, RuntimeError, ValueError, AttributeError) as error:
        raise ModelError(f"{path}: not a complete adapter's state ({error}): begin a new one") from error
    return adapter


def _parts(files: Mapping[str, bytes], path: Path) -> tuple[dict[str, Tensor], dict[str, Any], GreyBox]:
    """Return what a state's files hold: tensors, the plain part, and the model."""
    missing = [name for name in (PLAIN, TENSORS, MODEL) if name not in files]
    if missing:
        raise ModelError(f"{path}: {', '.join(missing)} is missing: this is no adapter's state")
    tensors = tensors_from_bytes(files[TENSORS], where=TENSORS, finite=False)
    try:
        plain = json.loads(files[PLAIN])
    except (ValueError, RecursionError) as error:
        raise ModelError(f"{path}: {PLAIN} cannot be read ({error}): begin a new one") from error
    return {k: v.clone() for k, v in tensors.items()}, plain, from_contents(files, path)


def _plain(adapter: Adapter) -> dict[str, Any]:
    off = adapter._off_until
    return {
        "scheme": {"scheme": adapter.scheme.name, **adapter.scheme.options()},
        "guards": adapter.guards.to_dict(),
        "counts": asdict(adapter.counts),
        "gate": adapter._gate.state(),
        "paused": adapter.paused,
        "added": adapter.added,
        "passive": adapter._original.bank.passive,
        "debt": adapter._debt,
        "resting": adapter._resting,
        "off_until": None if off == -float("inf") else off,
        "history": len(adapter._predictor.history),
        "last": adapter._predictor.last is not None,
        "held": len(adapter._held),
        "off_cause": adapter._off_cause,
        "monitor": None if adapter._monitor is None else adapter._monitor.state()[0],
    }


def _tensors(adapter: Adapter) -> dict[str, Tensor]:
    parts: dict[str, dict[str, Tensor]] = {
        "original": copy.deepcopy(adapter._original.bank).state_dict(),
        "scheme": adapter.scheme.state(),
        "shadow": adapter._shadow.state(),
        "trial": adapter._trial.state(),
        "noise": adapter._noise.state(),
        "bounds": adapter._bounds.state(),
        "consistency": adapter._consistency.state(),
        "positions": adapter._positions.state(),
        "trusted": adapter._trusted.state(),
        "recent": adapter._recent.state(),
        "steps": adapter._steps.state(),
    }
    found = {f"{part}/{name}": v for part, tensors in parts.items() for name, v in tensors.items()}
    for k, sample in enumerate(adapter._predictor.history):
        found |= _of(sample, f"history.{k}")
    for k, (sample, nu, missing) in enumerate(adapter._held):
        found |= {**_of(sample, f"held.{k}"), f"held.{k}.nu": nu, f"held.{k}.missing": missing}
    if adapter._monitor is not None:
        found |= {f"monitor/{name}": v for name, v in adapter._monitor.state()[1].items()}
        for k, sample in enumerate(adapter._monitor.pending):
            found |= _of(sample, f"pending.{k}")
    if adapter._predictor.last is not None:
        found |= _of(adapter._predictor.last, "last")
    return found


def _part(tensors: dict[str, Tensor], part: str) -> dict[str, Tensor]:
    prefix = f"{part}/"
    return {name[len(prefix) :]: v for name, v in tensors.items() if name.startswith(prefix)}


def _of(sample: Sample, where: str) -> dict[str, Tensor]:
    vectors = {n: getattr(sample, n) for n in _VECTORS}
    given = {f"{where}/{n}": v for n, v in vectors.items() if v is not None}
    return {f"{where}/t": torch.tensor(sample.t, dtype=torch.float64), **given}


def _sample(tensors: dict[str, Tensor], where: str) -> Sample:
    own = _part(tensors, where)
    return Sample(float(own.pop("t")), **own)
