"""Slocum gliders' sensors: radians and metres; pitch is positive nose up; each sensor has separate times.

The buoyancy drive says in cm3 what it has pumped out: `m_ballast_pumped` of shallow gliders, `m_de_oil_vol` of deep ones.
"""

from __future__ import annotations

from auvnn.logs.mapping_rules.moos import present
from auvnn.logs.mapping_rules.rule import Rule

_KIND = "slocum"
RULES = [
    Rule(
        "attitude", _KIND, present(("theta", "m_pitch", {}), ("phi", "m_roll", {}), ("psi", "m_heading", {}))
    ),
    Rule("depth", _KIND, present(("z", "m_depth", {}))),
    Rule("ballast", _KIND, present(("ballast", "m_ballast_pumped", {"scale": 1e-6}))),
    Rule("ballast", _KIND, present(("ballast", "m_de_oil_vol", {"scale": 1e-6}))),
    Rule("fins", _KIND, present(("fin_1", "m_fin", {}))),
    Rule("altitude", _KIND, present(("altitude", "m_altitude", {}))),
    Rule("voltage", _KIND, present(("voltage", "m_battery", {}))),
]
