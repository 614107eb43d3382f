"""Schemes of online adaptation: how one sample moves the weights, one small file each."""

from __future__ import annotations

from auvnn.catalogue import Catalogue

ONLINE_SCHEMES = Catalogue(
    "online scheme",
    {
        "rls": "auvnn.online.schemes.rls:RLS",
        "sgd": "auvnn.online.schemes.sgd:SGD",
        "replay": "auvnn.online.schemes.replay:ExperienceReplay",
    },
    "auvnn.online_schemes",
)

__all__ = ["ONLINE_SCHEMES"]
