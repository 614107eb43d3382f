"""Slocum gliders' sensors: radians, metres, seconds since 1970; pitch is positive nose up."""

from __future__ import annotations

from auvnn.logs.known.rule import Rule, triple

RULES = [
    Rule("attitude", "slocum", triple("phi theta psi", "m_roll m_pitch m_heading"), 1),
    Rule("depth", "slocum", {"z": "m_depth"}, 1),
    Rule("fins", "slocum", {"fin_1": "m_fin"}, 1),
    Rule("altitude", "slocum", {"altitude": "m_altitude"}, 1),
    Rule("voltage", "slocum", {"voltage": "m_battery"}, 1),
]
