"""A log as ROS 2 messages in MCAP, for PlotJuggler, Foxglove, rviz and the like.

`/auvnn/odometry` is a nav_msgs/Odometry in ENU and FLU (REP 103), `/auvnn/log` a sensor_msgs/JointState whose names are
the canonical columns and whose positions are their values: commands, accelerations, altitude, voltage and the rest.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from auvnn.errors import InputError, MissingExtra, refuse_device
from auvnn.logs.channels import POSITION, QUATERNION, VELOCITY
from auvnn.logs.signals.rotation import multiply

if TYPE_CHECKING:
    from auvnn.logs.log import Log
    from auvnn.logs.run import Run

_EPOCH = 1_000_000_000_000_000_000  # ns since 1970 of t = 0 in a log without dates
_DATES = 1e8  # s
_SIGNS = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
_BODY = np.array([0.0, 1.0, 0.0, 0.0])
_WORLD = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
ODOMETRY, REST = "/auvnn/odometry", "/auvnn/log"


def write_mcap(log: Log, path: Path) -> Path:
    """Write the log, whole or not at all; several runs follow each other as they are, told apart by the column `run`.

    Raises:
        InputError: it cannot be written.
        MissingExtra: rosbags is not there.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtra("rosbags", "ros", "writing MCAP") from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    refuse_device(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # rosbags writes a folder with the bag and a description of it; a single MCAP file needs none.
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
            inside = Path(folder) / "bag"
            with Writer(inside, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
                odometry = writer.add_connection(ODOMETRY, "nav_msgs/msg/Odometry", typestore=store)
                rest = writer.add_connection(REST, "sensor_msgs/msg/JointState", typestore=store)
                for run, begin in zip(log.runs, _begins(log), strict=True):
                    _write(run, begin, writer, odometry, rest, store)
            done = next(inside.glob("*.mcap"))
            os.chmod(done, 0o644)
            os.replace(done, path)
    except OSError as problem:
        raise InputError(f"{path} cannot be written: {problem.strerror}") from problem
    return path


def _begins(log: Log) -> list[int]:
    """Return what to add to each run's times, ns: runs that would overlap are put one after the other, a minute apart."""
    begins, last = [], None
    for run in log.runs:
        begin = 0 if run.t[0] > _DATES else _EPOCH
        first = begin + round(float(run.t[0]) * 1e9)
        if last is not None and first <= last:
            begin += last - first + 60_000_000_000
        begins.append(begin)
        last = begin + round(float(run.t[-1]) * 1e9)
    return begins


def _write(run: Run, begin: int, writer: Any, odometry: Any, rest: Any, store: Any) -> None:
    kinds = {name.split("/")[-1]: kind for name, kind in store.types.items()}
    position = np.full((run.samples, 3), np.nan) if run.position is None else run.position
    position = position[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])
    # The half turns between the frames are their own inverses up to sign.
    attitude = multiply(multiply(_WORLD, run.quaternion), _BODY)
    velocity = run.nu * _SIGNS
    covered = {*QUATERNION, *VELOCITY, *POSITION, "t"}
    others = [(name, column) for name, column in run.columns() if name not in covered]
    names = ["run", *(name for name, _ in others)]
    values = np.stack([np.full(run.samples, float(run.number)), *(column for _, column in others)], axis=1)
    none, empty = np.zeros(36), np.zeros(0)
    for i in range(run.samples):
        stamp = begin + round(float(run.t[i]) * 1e9)
        time = kinds["Time"](sec=stamp // 1_000_000_000, nanosec=stamp % 1_000_000_000)
        header = kinds["Header"](stamp=time, frame_id="odom")
        w, x, y, z = attitude[i]
        pose = kinds["Pose"](kinds["Point"](*position[i]), kinds["Quaternion"](x, y, z, w))
        twist = kinds["Twist"](kinds["Vector3"](*velocity[i, :3]), kinds["Vector3"](*velocity[i, 3:]))
        message = kinds["Odometry"](
            header,
            "base_link",
            kinds["PoseWithCovariance"](pose, none),
            kinds["TwistWithCovariance"](twist, none),
        )
        writer.write(odometry, stamp, store.serialize_cdr(message, "nav_msgs/msg/Odometry"))
        message = kinds["JointState"](header, names, values[i], empty, empty)
        writer.write(rest, stamp, store.serialize_cdr(message, "sensor_msgs/msg/JointState"))
