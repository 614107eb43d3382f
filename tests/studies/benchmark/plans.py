"""Plans of the repository with options for small logs, for tests."""

from __future__ import annotations

from typing import Any

from auvnn.config import config_dir, read_yaml
from auvnn.studies.benchmark import cases

OPTIONS: dict[str, Any] = {
    "effects": "all", "sizes": "medium", "noises": "realistic", "excitations": "multisine", "vehicles": "rov95",
    "coefficients": "exact", "repeats": 1, "seed": 1, "runs": 2, "duration": 15.0, "rate": 20.0, "workers": 1,
}  # fmt: skip


def of_plan(name: str) -> tuple[dict[str, Any], list[Any]]:
    """Return the options with a plan, and its cases."""
    options = {**OPTIONS, "plan": read_yaml(config_dir() / "plan" / f"{name}.yaml")}
    return options, cases(options)
