"""Results in words: the few lines that a verb prints of its answer."""

from __future__ import annotations

from typing import Any


def horizons(rollout: dict[str, dict[str, Any]]) -> list[str]:
    """Return one line per horizon: the error, and that of holding the velocity."""
    return [f"{_seconds(horizon)}: {_result(result)}" for horizon, result in rollout.items()]


def _seconds(horizon: str) -> str:
    return f"{horizon} run" if horizon == "full" else f"{horizon} s free running"


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"


def _result(result: dict[str, Any]) -> str:
    count = result.get("diverged") or 0
    lost = f", {count} windows diverged" if count else ""
    floor = result.get("noise_floor")
    noise = "" if floor is None else f", noise alone {_number(floor)}"
    return f"error {_number(result['total'])}, persistence {_number(result['persistence'])}{noise}{lost}"
