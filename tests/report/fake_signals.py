"""Made-up signals, errors and regimes, of the shapes that answers hold."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

CHANNELS = "uvwpqr"
AXES = "XYZKMN"
HOSTILE = "<script>alert('x')</script>\x1b[31m\u202e$\\frac{\ud800 & \"q\" <img src=x onerror=alert(1)>"


class Fake(SimpleNamespace):
    """Attributes, and a `to_dict` of those that are plain."""

    json = ()

    def to_dict(self) -> dict:
        return {k: getattr(self, k) for k in self.json if hasattr(self, k)}


def times(n: int, dt: float = 0.05) -> np.ndarray:
    return np.arange(n) * dt


def motion(t: np.ndarray, seed: int = 0, noise: float = 4e-3) -> np.ndarray:
    """Return a measured velocity (N, 6)."""
    rng = np.random.default_rng(seed)
    rate = np.array([0.05, 0.08, 0.06, 0.2, 0.15, 0.1]) * (1 + 0.1 * seed)
    size = np.array([0.6, 0.3, 0.2, 0.1, 0.12, 0.4])
    slow = size * np.sin(2 * np.pi * rate * t[:, None] + np.arange(6))
    return (
        slow
        + 0.3 * size * np.sin(2 * np.pi * 3.1 * rate * t[:, None])
        + noise * rng.standard_normal((t.size, 6))
    )


def drift(t: np.ndarray, size: float) -> np.ndarray:
    """Return the error of free running in windows of 5 s, (N, 6)."""
    window = (t % 5.0)[:, None] / 5.0
    return (
        size * window * np.array([0.15, -0.12, 0.03, 0.01, 0.02, 0.1]) * (1 + 0.3 * np.sin(0.3 * t))[:, None]
    )


def rollout(scale: float, full: float | None = 0.9) -> dict:
    out = {}
    for i, horizon in enumerate(("0.5", "1", "2", "5", "10", "full")):
        entry: dict = {
            c: {
                "rmse": 0.01 * scale * (i + 1),
                "nrmse": None if c == "p" else scale * (0.05 + 0.07 * i) * (1 + 0.1 * k),
            }
            for k, c in enumerate(CHANNELS)
        }
        total = full * scale if horizon == "full" and full else scale * (0.05 + 0.07 * i)
        entry |= {
            "total": total,
            "persistence": None if horizon == "full" else 0.2 + 0.25 * i,
            "diverged": int(i == 4),
        }
        out[horizon] = entry
    return out


def one_step(scale: float) -> dict:
    return {
        f"d{c}": {"rmse": 0.02 * scale, "noise_floor": 0.01, "r2": 1 - 0.1 * scale * (i + 1)}
        for i, c in enumerate(CHANNELS)
    }


def regimes(seed: int = 0) -> dict:
    rng = np.random.default_rng(seed)
    floor = np.array([2, 2, 2, 0.3, 0.3, 0.3])
    edges = {
        "speed": ("m/s", np.linspace(0, 1.2, 7)),
        "turn rate": ("rad/s", np.linspace(0, 0.5, 6)),
        "attitude": ("rad", np.linspace(-0.6, 0.6, 7)),
        "heading": ("rad", np.linspace(-np.pi, np.pi, 9)),
        "command": ("1", np.linspace(0, 1, 6)),
        "depth": ("m", np.array([0.0, 2.0, 5.0, 10.0, 20.0])),
        "time": ("s", np.linspace(0, 600, 9)),
    }
    out = {}
    for name, (unit, e) in edges.items():
        bins = len(e) - 1
        rms = floor[:, None] * (1 + rng.exponential(0.4, (6, bins)))
        if name == "heading":
            rms[0] *= 2 + 5 * np.abs(np.sin(np.arange(bins)))
            rms[1] *= 3 + 6 * np.abs(np.cos(np.arange(bins)))
        counts = rng.integers(50, 4000, bins)
        if name == "depth":
            counts[-1] = 0
            rms[:, -1] = np.nan
        out[name] = {"edges": e.tolist(), "unit": unit, "rms": rms, "count": counts}
    return out
