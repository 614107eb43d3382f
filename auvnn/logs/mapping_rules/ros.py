"""ROS messages: body axes forward, left, up, world axes east, north, up (REP 103), unless they say otherwise."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from auvnn.logs.channels import is_canonical
from auvnn.logs.mapping_rules.rule import Lie, Rule, numbered_columns, pwm_channels, triple
from auvnn.logs.recording import Recording, Topic

_XYZ = ("x", "y", "z")


def _frame(topic: Topic) -> Mapping[str, Any]:
    words = {k: v.lower() for k, v in topic.words.items()}
    body = words.get("child_frame_id", words.get("header.frame_id", ""))
    world = words.get("header.frame_id", "")
    return {
        "body": "FRD" if "frd" in body or body.endswith("_ned") else "FLU",
        "world": "NED" if re.search(r"(^|[_/])ned($|[_/])", world) else "ENU",
    }


def _quaternion(path: str) -> dict[str, str]:
    return {f"q{a}": f"{path}.{a}" for a in "wxyz"}


def _vector(names: str, path: str, **more: Any) -> dict[str, Any]:
    return triple(names, " ".join(f"{path}.{a}" for a in _XYZ), **more)


def _imu_attitude(_: Recording, topic: Topic) -> dict[str, str]:
    covariance = topic.columns.get("orientation_covariance[0]")
    # -1 says that this sensor knows no attitude.
    return {} if covariance is not None and (covariance == -1.0).all() else _quaternion("orientation")


def _joints(block: str) -> Any:
    def columns(_: Recording, topic: Topic) -> dict[str, str]:
        found = {}
        for key, name in topic.words.items():
            match = re.fullmatch(r"name\[(\d+)\]", key)
            if match and is_canonical(name) and _block_of(name) == block:
                found[name] = f"position[{match[1]}]"
        return found

    return columns


def _block_of(name: str) -> str:
    if name == "run":
        return "runs"
    if name.startswith(("thruster_", "tau_")):
        return "commands"
    if name.startswith("fin_"):
        return "fins"
    return {"altitude": "altitude", "voltage": "voltage"}.get(name, "acceleration" if name[0] == "d" else "")


def _one_per_thruster(recording: Recording, topic: Topic) -> dict[str, Any]:
    """Return thrusters of topics that hold one number each, `/rov/thruster3/cmd_thrust`."""
    match = re.search(r"^(.*thruster_?)(\d+)(/.*)?$", topic.name)
    if not match:
        return {}
    found = {}
    for other in recording.topics.values():
        same = re.search(r"^(.*thruster_?)(\d+)(/.*)?$", other.name)
        if same and (same[1], same[3]) == (match[1], match[3]) and "data" in other.columns:
            found[int(same[2])] = other.name
    first = min(found, default=0)
    if sorted(found) != list(range(first, first + len(found))) or match[2] != str(first):
        return {}
    return {f"thruster_{n - first + 1}": {"from": f"@{name}.data"} for n, name in sorted(found.items())}


_ODOMETRY, _IMU = "nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu"
_RAW = {"body": "FRD"}
RULES = [
    Rule("attitude", _ODOMETRY, _quaternion("pose.pose.orientation"), 1, frame=_frame),
    Rule("velocity", _ODOMETRY, _vector("u v w", "twist.twist.linear"), 1, frame=_frame),
    Rule("rates", _ODOMETRY, _vector("p q r", "twist.twist.angular"), 1, frame=_frame),
    Rule("position", _ODOMETRY, _vector("x y z", "pose.pose.position"), 1, frame=_frame),
    Rule("attitude", _IMU, _imu_attitude, 3, frame=_frame),
    Rule("rates", _IMU, _vector("p q r", "angular_velocity"), 2, frame=_frame),
    Rule("velocity", "marine_acoustic_msgs/msg/Dvl",
         _vector("u v w", "velocity", valid={"from": "num_good_beams", "above": 2}), 2, frame=_RAW,
         note="{topic}: the DVL is taken as mounted with its axes along the vehicle's, looking down"),
    Rule("altitude", "marine_acoustic_msgs/msg/Dvl", {"altitude": "altitude"}, 1, frame=_RAW),
    *(Rule("attitude", f"geometry_msgs/msg/{k}", _quaternion(f"{p}.orientation"), 4, frame=_frame)
      for k, p in (("PoseStamped", "pose"), ("PoseWithCovarianceStamped", "pose.pose"))),
    *(Rule("position", f"geometry_msgs/msg/{k}", _vector("x y z", f"{p}.position"), 4, frame=_frame)
      for k, p in (("PoseStamped", "pose"), ("PoseWithCovarianceStamped", "pose.pose"))),
    *(Rule("velocity", f"geometry_msgs/msg/{k}", _vector("u v w", f"{p}.linear", **{"in": "world"}), 4,
           "velocity_local$|ap/twist/filtered$", frame={"world": "ENU"},
           note="{topic}: velocities along the world's axes, whatever its frame_id says; turned into the body")
      for k, p in (("TwistStamped", "twist"), ("TwistWithCovarianceStamped", "twist.twist"))),
    *(Rule("velocity", f"geometry_msgs/msg/{k}", _vector("u v w", f"{p}.linear"), 3, "^(?!.*(velocity_local|ap/twist))",
           frame=_frame, note="{topic}: taken as along the body's axes")
      for k, p in (("TwistStamped", "twist"), ("TwistWithCovarianceStamped", "twist.twist"))),
    *(Rule("rates", f"geometry_msgs/msg/{k}", _vector("p q r", f"{p}.angular"), 4, "^(?!.*(velocity_local|ap/twist))",
           frame=_frame) for k, p in (("TwistStamped", "twist"), ("TwistWithCovarianceStamped", "twist.twist"))),
    Rule("depth", "sensor_msgs/msg/FluidPressure", {"z": {"from": "fluid_pressure", "pressure": {}}}, 5,
         frame={"world": "NED"}, note="{topic}: depth from pressure with 101325 Pa at the surface and 1025 kg/m3"),
    Rule("commands", "mavros_msgs/msg/RCOut", lambda r, t: pwm_channels(t, "channels[{}]", r, 1), 2,
         note="{topic}: thrusters in the order of the channels, 1500 us neutral, 400 us full"),
    Rule("commands", "sensor_msgs/msg/JointState", _joints("commands"), 1, frame=_RAW),
    Rule("fins", "sensor_msgs/msg/JointState", _joints("fins"), 1, frame=_RAW),
    Rule("altitude", "sensor_msgs/msg/JointState", _joints("altitude"), 2, frame=_RAW),
    Rule("voltage", "sensor_msgs/msg/JointState", _joints("voltage"), 2, frame=_RAW),
    Rule("acceleration", "sensor_msgs/msg/JointState", _joints("acceleration"), 2, frame=_RAW),
    Rule("runs", "sensor_msgs/msg/JointState", _joints("runs"), 1),
    Rule("commands", r"std_msgs/msg/Float(64|32)", _one_per_thruster, 3, frame=_RAW),
    Rule("commands", "std_msgs/msg/Float64MultiArray", lambda _, t: numbered_columns(t, "data[{}]", "thruster"), 4,
         "thruster|motor|actuator", frame=_RAW, note="{topic}: taken as thruster commands in the model's order"),
    Rule("commands", "geometry_msgs/msg/WrenchStamped",
         {**_vector("tau_X tau_Y tau_Z", "wrench.force"), **_vector("tau_K tau_M tau_N", "wrench.torque")}, 6,
         frame=_frame),
    Rule("voltage", "sensor_msgs/msg/BatteryState", {"voltage": "voltage"}, 1),
    Rule("altitude", "sensor_msgs/msg/Range", {"altitude": "range"}, 3, "alt|down|bottom|dvl|ping|sonar"),
]  # fmt: skip

LIES = [
    Lie(_ODOMETRY, r"global_position/local$",
        "mavros fills its twist with (vy, vx, vz) of the global position over 100, z down, under a body frame's name; "
        "use /mavros/local_position/odom"),
    Lie(r"geometry_msgs/msg/Twist.*", r"gps_vel$|global_position/raw/gps_vel$",
        "it is the velocity over ground of the satellite receiver along the world's axes; use local_position/odom"),
]  # fmt: skip
