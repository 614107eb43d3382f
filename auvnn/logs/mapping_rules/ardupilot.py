"""ArduPilot's DataFlash messages: NED and FRD; angles in degrees, multipliers of the file applied."""

from __future__ import annotations

from collections.abc import Callable

from auvnn.logs.mapping_rules.rule import Rule, pwm_channels, triple
from auvnn.logs.recording import Recording, Topic

_PWM = (
    "{topic}: thrusters in the order of the motors, 1500 us neutral, 400 us full; give your thruster's span"
)
_OVER = {"over": {"from": "dt", "unit": "us"}}


def _core(name: str) -> str:
    return rf"^{name}(\[(0|primary)\])?$"


def _of_primary(names: str, fields: str, **more: str) -> Callable[[Recording, Topic], dict[str, object]]:
    """Return columns of the estimator's core in use, where it has several."""

    def columns(_: Recording, topic: Topic) -> dict[str, object]:
        base, bracket, _rest = topic.name.partition("[")
        mark = "[primary]" if bracket else ""
        pairs = list(zip(names.split(), fields.split(), strict=True))
        if not all(f in topic.columns for _, f in pairs):
            return {}
        return {n: {"from": f"@{base}{mark}.{f}", **more} for n, f in pairs}

    return columns


RULES = [
    Rule("attitude", "dataflash", _of_primary("qw qx qy qz", "Q1 Q2 Q3 Q4"), 1, _core("XKQ")),
    Rule("attitude", "dataflash", _of_primary("qw qx qy qz", "Q1 Q2 Q3 Q4"), 2, _core("NKQ")),
    Rule("attitude", "dataflash", triple("phi theta psi", "Roll Pitch Yaw", unit="deg"), 3, "^ATT$"),
    Rule("velocity", "dataflash", triple("u v w", "PosDX PosDY PosDZ", **_OVER), 1, "^VISO$"),
    Rule("velocity", "dataflash", _of_primary("u v w", "VN VE VD", **{"in": "world"}), 2, _core("XKF1"),
         note="{topic}: velocities of the estimator, along north, east, down; turned into the body"),
    Rule("velocity", "dataflash", _of_primary("u v w", "VN VE VD", **{"in": "world"}), 3, _core("NKF1")),
    Rule("rates", "dataflash", triple("p q r", "R P Y", unit="deg/s"), 1, "^RATE$"),
    Rule("rates", "dataflash", triple("p q r", "GyrX GyrY GyrZ"), 2, r"^IMU(\[0\])?$"),
    Rule("rates", "dataflash", triple("p q r", "GyrX GyrY GyrZ"), 3, r"^GYR(\[0\])?$"),
    Rule("position", "dataflash", _of_primary("x y z", "PN PE PD"), 1, _core("XKF1")),
    Rule("position", "dataflash", _of_primary("x y z", "PN PE PD"), 2, _core("NKF1")),
    Rule("depth", "dataflash", {"z": {"from": "Alt", "scale": -1}}, 3, "^CTUN$"),
    Rule("commands", "dataflash", lambda r, t: pwm_channels(t, "C{}", r), 1, "^RCOU$", note=_PWM),
    Rule("altitude", "dataflash", {"altitude": "Dist"}, 1, r"^RFND(\[0\])?$"),
    Rule("altitude", "dataflash", {"altitude": "Dist1"}, 2, r"^RFND(\[0\])?$"),
    Rule("voltage", "dataflash", {"voltage": "Volt"}, 1, r"^BAT(\[0\])?$"),
    Rule("voltage", "dataflash", {"voltage": "BatVolt"}, 2, "^MOTB$"),
]  # fmt: skip
