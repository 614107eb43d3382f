"""Functions and tasks as bytes, on their way to a worker."""

from __future__ import annotations

import pickle
from typing import Any


def pack(value: Any) -> bytes:
    """Return a value as bytes."""
    return pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)


def sendable(error: BaseException) -> BaseException:
    """Return an error that survives being sent: itself, or its words where it cannot be packed."""
    try:
        if type(pickle.loads(pack(error))) is type(error):
            return error
    except Exception:
        pass
    return RuntimeError(f"{type(error).__name__}: {error}")
