"""Logs: reading, writing, judging and differentiating what was measured."""

from auvnn.logs.check import check
from auvnn.logs.leakage import leakage
from auvnn.logs.log import Log
from auvnn.logs.quality.findings import Finding
from auvnn.logs.quality.quality import Quality
from auvnn.logs.readers import READERS
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.run import Run
from auvnn.logs.signals.derivatives import (
    LocalPolynomial,
    bandwidth_hz,
    local_polynomial,
    noise_gain,
    response,
)
from auvnn.logs.signals.noise import noise_std

__all__ = [
    "READERS",
    "Finding",
    "LocalPolynomial",
    "Log",
    "Quality",
    "Repair",
    "Run",
    "bandwidth_hz",
    "check",
    "leakage",
    "local_polynomial",
    "noise_gain",
    "noise_std",
    "response",
]
