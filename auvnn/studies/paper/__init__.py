"""The paper's three case studies, one file each, and what they share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from auvnn.catalogue import Catalogue

if TYPE_CHECKING:
    from auvnn.studies.paper.answer import Study

CASES = Catalogue(
    "case",
    {
        "noise_free": "auvnn.studies.paper.noise_free:noise_free",
        "noisy": "auvnn.studies.paper.noisy:noisy",
        "payload": "auvnn.studies.paper.payload:payload",
    },
    "auvnn.cases",
)


def run_study(options: Mapping[str, Any], progress: Callable[[str], None] | None = None) -> Study:
    """Run one case study: simulate the plant, train offline, run free, and measure.

    Args:
        options: those of `configs/study.yaml`, with a `case` composed into them.
        progress: called with the state of the work, in words.

    Raises:
        ConfigError: an option is unknown or out of range.
    """
    from auvnn.studies.paper.options import Options

    chosen = Options.read(options)
    return CASES.get(chosen.name)(chosen, progress or (lambda words: None))


__all__ = ["CASES", "run_study"]
