"""What to say when a column is missing: which column of the file it might be, and how to map it."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

from auvnn.logs.channels import is_canonical

_UNIT = re.compile(
    r"[\s_]*[\[(]\s*(?P<bracket>[^\])]*)\s*[\])]\s*$"
    r"|[\s_]+(?P<suffix>m_?/?s2?|mps|rad_?/?s|rads|deg_?/?s|dps|degs?|rad|s|sec|ms|us|ns|m|n|nm|v|volts?)$",
    re.IGNORECASE,
)
_FORCES, _MOMENTS = (("X", "x"), ("Y", "y"), ("Z", "z")), (("K", "x"), ("M", "y"), ("N", "z"))
_SYNONYMS: dict[str, tuple[str, ...]] = {
    "t": ("time", "timestamp", "stamp", "seconds", "times", "elapsedtime", "timeus", "timems"),
    "phi": ("roll", "rollangle"),
    "theta": ("pitch", "pitchangle"),
    "psi": ("yaw", "heading", "yawangle", "hdg"),
    "altitude": ("alt", "height", "heightabovebottom"),
    "voltage": ("volt", "battery", "batteryvoltage", "vbat"),
    "z": ("depth", "positionz", "posz", "down", "pd"),
    "x": ("positionx", "posx", "north", "pn"),
    "y": ("positiony", "posy", "east", "pe"),
    "u": ("surge", "linearx", "velocityx", "velx", "vx", "twistlinearx", "surgevelocity"),
    "v": ("sway", "lineary", "velocityy", "vely", "vy", "twistlineary", "swayvelocity"),
    "w": ("heave", "linearz", "velocityz", "velz", "vz", "twistlinearz", "heavevelocity"),
    "p": ("rollrate", "angularx", "gyrox", "gyrx", "omegax", "wx", "rollspeed", "twistangularx"),
    "q": ("pitchrate", "angulary", "gyroy", "gyry", "omegay", "wy", "pitchspeed", "twistangulary"),
    "r": ("yawrate", "angularz", "gyroz", "gyrz", "omegaz", "wz", "yawspeed", "twistangularz"),
    **{f"q{a}": (f"orientation{a}", f"quat{a}", f"quaternion{a}", f"rotation{a}") for a in "wxyz"},
    **{f"tau_{c}": (f"force{a}", f"f{a}", f"wrenchforce{a}") for c, a in _FORCES},
    **{f"tau_{c}": (f"torque{a}", f"moment{a}", f"m{a}", f"wrenchtorque{a}") for c, a in _MOMENTS},
    **{name: (name[0] + "v" + name[1:], name[1:] + "dot", "acc" + name[1:]) for name in ("du", "dv", "dw")},
}
_ACTUATOR = re.compile(
    r"(thruster|motor|pwm|servo|thr|cmd|command|positivewidthus|rcout)(\d+)", re.IGNORECASE
)


def split_unit(name: str) -> tuple[str, str]:
    """Return a column name without its unit, and the unit ("" where there is none)."""
    found = _UNIT.search(name)
    if not found or found.start() == 0:
        return name, ""
    return name[: found.start()], (found["bracket"] or found["suffix"] or "").lower()


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", split_unit(name)[0].lower())


def likely(wanted: str, names: Iterable[str]) -> str | None:
    """Return the column of the file that probably holds the canonical column `wanted`, or None."""
    plain = {_plain(name): name for name in names if not is_canonical(name)}
    for key in (_plain(wanted), *_SYNONYMS.get(wanted, ())):
        if key in plain:
            return plain[key]
    words = [s for s in _SYNONYMS.get(wanted, ()) if len(s) > 4]
    ends = [name for key, name in plain.items() if any(key.endswith(s) for s in words)]
    if len(ends) == 1:
        return ends[0]
    near = difflib.get_close_matches(_plain(wanted), plain, n=1, cutoff=0.75) if len(wanted) > 2 else []
    return plain[near[0]] if near else None


def actuator_columns(names: Iterable[str]) -> list[str]:
    """Return the columns that look like actuator commands, in the order of their numbers."""
    found = []
    for name in names:
        match = _ACTUATOR.search(re.sub(r"[^A-Za-z0-9]", "", name))
        if match and not is_canonical(name):
            found.append((int(match[2]), name))
    return [name for _, name in sorted(found)]


def hint(missing: Sequence[str], names: Sequence[str]) -> str:
    """Return the end of an error message: a mapping to copy, or the columns that there are."""
    pairs = {m: found for m in missing if (found := likely(m, names))}
    if not pairs:
        shown = ", ".join(map(repr, names[:20])) + (", ..." if len(names) > 20 else "")
        return f"The file has: {shown}. A mapping file can rename them (mapping=)"
    columns = ", ".join(f"{m}: {{from: {_quoted(found)}}}" for m, found in pairs.items())
    units = {split_unit(found)[1] for found in pairs.values()}
    more = ""
    if any(u.startswith("deg") and "s" not in u[3:] for u in units):
        more += "; angles: deg"
    if units & {"deg/s", "deg_s", "degs", "dps"}:
        more += "; rates: deg"
    time_unit = split_unit(pairs["t"])[1] if "t" in pairs else ""
    if time_unit in ("ms", "us", "ns"):
        more += f"; time: {{unit: {time_unit}}}"
    return f"Did you mean (mapping file): columns: {{{columns}}}{more}"


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z_][\w./]*", name) else "'" + name.replace("'", "''") + "'"
