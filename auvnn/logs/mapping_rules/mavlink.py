"""MAVLink messages of the vehicle's autopilot, in the units of the common dialect: NED and FRD."""

from __future__ import annotations

from auvnn.logs.mapping_rules.rule import Rule, pwm_channels, triple

_SERVO = (
    "{topic}: thrusters in the order of the motors, 1500 us neutral, 400 us full; give your thruster's span"
)


def _over(key: str = "time_delta_usec") -> dict[str, object]:
    return {"over": {"from": key, "unit": "us"}}


RULES = [
    Rule("attitude", "mavlink", triple("qw qx qy qz", "q1 q2 q3 q4"), 1, "^ATTITUDE_QUATERNION$"),
    Rule("attitude", "mavlink", triple("phi theta psi", "roll pitch yaw"), 2, "^ATTITUDE$"),
    Rule("rates", "mavlink", triple("p q r", "rollspeed pitchspeed yawspeed"), 1, "^ATTITUDE_QUATERNION$"),
    Rule("rates", "mavlink", triple("p q r", "rollspeed pitchspeed yawspeed"), 2, "^ATTITUDE$"),
    Rule("velocity", "mavlink", triple("u v w", "vx vy vz"), 1, "^ODOMETRY$", when={"child_frame_id": 12}),
    Rule("velocity", "mavlink", triple("u v w", "position_delta[0] position_delta[1] position_delta[2]", **_over()), 2,
         "^VISION_POSITION_DELTA$"),
    Rule("velocity", "mavlink", triple("u v w", "vx vy vz", **{"in": "world"}), 3, "^LOCAL_POSITION_NED$",
         note="{topic}: velocities along north, east, down; turned into the body; too slow a telemetry for inertia"),
    Rule("position", "mavlink", triple("x y z", "x y z"), 2, "^LOCAL_POSITION_NED$"),
    Rule("depth", "mavlink", {"z": {"from": "alt", "scale": -1}}, 3, "^VFR_HUD$"),
    Rule("depth", "mavlink", {"z": {"from": "press_abs", "unit": "hPa", "pressure": {}}}, 4, "^SCALED_PRESSURE2$",
         note="{topic}: depth from pressure with 101325 Pa at the surface and 1025 kg/m3"),
    Rule("commands", "mavlink", lambda r, t: pwm_channels(t, "servo{}_raw", r), 1, r"^SERVO_OUTPUT_RAW(\[0\])?$",
         note=_SERVO),
    Rule("altitude", "mavlink", {"altitude": {"from": "current_distance", "unit": "cm"}}, 1,
         r"^DISTANCE_SENSOR(\[0\])?$"),
    Rule("voltage", "mavlink", {"voltage": {"from": "voltage_battery", "unit": "mV"}}, 2, "^SYS_STATUS$"),
]  # fmt: skip
