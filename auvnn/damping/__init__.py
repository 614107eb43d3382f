"""Damping forms: what the force against the motion may look like, one small file each."""

from __future__ import annotations

from auvnn.catalogue import Catalogue

DAMPING = Catalogue(
    "damping form",
    {
        "mlp": "auvnn.damping.mlp:MLP",
        "polynomial": "auvnn.damping.polynomial:Polynomial",
        "dissipative": "auvnn.damping.dissipative:Dissipative",
        "zero": "auvnn.damping.zero:Zero",
    },
    "auvnn.damping",
)

__all__ = ["DAMPING"]
