"""Logs: reading, writing, judging and differentiating what was measured."""

from auvnn.logs.derivatives import LocalPolynomial, bandwidth_hz, local_polynomial, noise_gain, response
from auvnn.logs.findings import Finding
from auvnn.logs.log import Log
from auvnn.logs.noise import noise_std
from auvnn.logs.overlap import leakage
from auvnn.logs.quality import Quality, check
from auvnn.logs.readers import READERS
from auvnn.logs.repair import Repair
from auvnn.logs.run import Run

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
