"""Training schemes: how the parameters of the damping are found, one small file each."""

from __future__ import annotations

from auvnn.catalogue import Catalogue

SCHEMES = Catalogue(
    "training scheme",
    {
        "levenberg_marquardt": "auvnn.training.schemes.levenberg_marquardt:LevenbergMarquardt",
        "adam": "auvnn.training.schemes.adam:Adam",
        "sgd": "auvnn.training.schemes.sgd:SGD",
    },
    "auvnn.schemes",
)

__all__ = ["SCHEMES"]
