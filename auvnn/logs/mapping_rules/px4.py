"""PX4's topics in ULog: NED and FRD, quaternions scalar first."""

from __future__ import annotations

from auvnn.logs.mapping_rules.rule import Rule, numbered_columns, pwm_channels, triple
from auvnn.logs.recording import Recording, Topic

_Q = triple("qw qx qy qz", "q[0] q[1] q[2] q[3]")
_BODY, _NED = {"velocity_frame": 3}, {"velocity_frame": 1}
_GROUND = "^vehicle_odometry$"


def _motors(_: Recording, topic: Topic) -> dict[str, object]:
    # NaN is a motor that is off: a channel that never holds a number is none.
    return numbered_columns(topic, "control[{}]", "thruster")


def _outputs(recording: Recording, topic: Topic) -> dict[str, object]:
    return pwm_channels(topic, "output[{}]", recording, 1)


RULES = [
    Rule("attitude", "ulog", _Q, 1, "^vehicle_attitude$"),
    Rule("attitude", "ulog", _Q, 2, _GROUND),
    Rule("rates", "ulog", triple("p q r", "xyz[0] xyz[1] xyz[2]"), 1, "^vehicle_angular_velocity$"),
    Rule("rates", "ulog", triple("p q r", "angular_velocity[0] angular_velocity[1] angular_velocity[2]"), 2, _GROUND),
    Rule("velocity", "ulog", triple("u v w", "velocity[0] velocity[1] velocity[2]"), 1, _GROUND, when=_BODY),
    Rule("velocity", "ulog", triple("u v w", "velocity[0] velocity[1] velocity[2]", **{"in": "world"}), 2, _GROUND,
         when=_NED),
    Rule("velocity", "ulog", triple("u v w", "vx vy vz", **{"in": "world"}), 3, "^vehicle_local_position$",
         note="{topic}: velocities of the estimator, along north, east, down; turned into the body"),
    Rule("position", "ulog", triple("x y z", "position[0] position[1] position[2]"), 1, _GROUND, when={"pose_frame": 1}),
    Rule("position", "ulog", triple("x y z", "x y z"), 2, "^vehicle_local_position$"),
    Rule("commands", "ulog", _motors, 1, "^actuator_motors$"),
    Rule("commands", "ulog", _outputs, 3, r"^actuator_outputs(\[0\])?$",
         note="{topic}: thrusters in the order of the outputs, 1500 us neutral, 400 us full"),
    Rule("fins", "ulog", lambda _, t: numbered_columns(t, "control[{}]", "fin"), 1, "^actuator_servos$",
         note="{topic}: -1 to 1, taken as radians; give the scale of your fins"),
    Rule("altitude", "ulog", {"altitude": "current_distance"}, 1, r"^distance_sensor(\[0\])?$"),
    Rule("voltage", "ulog", {"voltage": "voltage_v"}, 1, r"^battery_status(\[0\])?$"),
]  # fmt: skip
