"""What the tests of storage keep: two files of a model, and a pickle that does something when it is opened."""

from __future__ import annotations

import os

import torch

from auvnn.storage import tensors_to_bytes

FILES = {"model.yaml": "name: ß\n", "weights.safetensors": tensors_to_bytes({"a": torch.arange(6.0)})}


class Bomb:
    def __reduce__(self):
        return (os.mkdir, ("bomb-went-off",))
