"""Writers of the field's formats that share nothing with the readers: other libraries, or bytes put down by hand."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from auvnn.logs import Log, Run

START = 1_750_000_000_000_000_000  # ns since 1970
FLU = np.array([1.0, -1.0, -1.0])
ODOMETRY = """std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/TwistWithCovariance
geometry_msgs/Twist twist
float64[36] covariance
================================================================================
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
COMMANDS = "float64[] data\n"
COMMANDS_TEXT = """std_msgs/MultiArrayLayout layout
float64[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""


def enu_flu(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position (N, 3), quaternion x, y, z, w (N, 4) and velocity (N, 6) in ENU and FLU, by rotation matrices."""
    wxyz = run.quaternion
    matrix = Rotation.from_quat(wxyz[:, [1, 2, 3, 0]]).as_matrix()
    world = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # ENU from NED
    body = np.diag(FLU)  # FRD from FLU
    xyzw = Rotation.from_matrix(world @ matrix @ body).as_quat()
    position = np.zeros((run.samples, 3)) if run.position is None else run.position @ world.T
    return position, xyzw, run.nu * np.concatenate([FLU, FLU])


def stamps(run: Run) -> list[int]:
    """Return the times, ns since 1970."""
    return [START + round(t * 1e9) for t in run.t]


def _odometry(position: Any, xyzw: Any, nu: Any, stamp: int) -> dict[str, Any]:
    axes = ("x", "y", "z")
    return {
        "header": {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": "odom"},
        "child_frame_id": "base_link",
        "pose": {"pose": {"position": dict(zip(axes, position, strict=True)),
                          "orientation": dict(zip((*axes, "w"), xyzw, strict=True))}, "covariance": [0.0] * 36},
        "twist": {"twist": {"linear": dict(zip(axes, nu[:3], strict=True)),
                            "angular": dict(zip(axes, nu[3:], strict=True))},
                  "covariance": [0.0] * 36},
    }  # fmt: skip


def mcap(log: Log, path: Path) -> Path:
    """ROS 2 in MCAP, by mcap-ros2-support; commands as a Float64MultiArray without a header."""
    from mcap_ros2.writer import Writer

    run = log.runs[0]
    position, xyzw, velocity = enu_flu(run)
    with path.open("wb") as stream:
        writer = Writer(stream)
        odometry = writer.register_msgdef("nav_msgs/msg/Odometry", ODOMETRY)
        commands = writer.register_msgdef("std_msgs/msg/Float64MultiArray", COMMANDS_TEXT)
        for i, stamp in enumerate(stamps(run)):
            message = _odometry(position[i].tolist(), xyzw[i].tolist(), velocity[i].tolist(), stamp)
            writer.write_message("/odom", odometry, message, log_time=stamp, publish_time=stamp)
            data = {"layout": {"dim": [], "data_offset": 0}, "data": run.thrusters[i].tolist()}
            writer.write_message("/thrusters", commands, data, log_time=stamp, publish_time=stamp)
        writer.finish()
    return path


def _rosbags(log: Log, writer: Any, typestore: Any, serialize: Any, ros1: bool) -> None:
    kinds = typestore.types
    run = log.runs[0]
    position, xyzw, velocity = enu_flu(run)
    make = {k.split("/")[-1]: v for k, v in kinds.items()}
    odometry = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=typestore)
    commands = writer.add_connection("/thrusters", "std_msgs/msg/Float64MultiArray", typestore=typestore)
    none = np.zeros(36)
    for i, stamp in enumerate(stamps(run)):
        time = kinds["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
        more = {"seq": i} if ros1 else {}
        header = kinds["std_msgs/msg/Header"](stamp=time, frame_id="odom", **more)
        pose = make["Pose"](make["Point"](*position[i]), make["Quaternion"](*xyzw[i]))
        twist = make["Twist"](make["Vector3"](*velocity[i, :3]), make["Vector3"](*velocity[i, 3:]))
        message = kinds["nav_msgs/msg/Odometry"](
            header,
            "base_link",
            make["PoseWithCovariance"](pose, none),
            make["TwistWithCovariance"](twist, none),
        )
        writer.write(odometry, stamp, serialize(message, "nav_msgs/msg/Odometry"))
        data = make["Float64MultiArray"](make["MultiArrayLayout"]([], 0), run.thrusters[i].copy())
        writer.write(commands, stamp, serialize(data, "std_msgs/msg/Float64MultiArray"))


def db3(log: Log, folder: Path) -> Path:
    """ROS 2 in sqlite3, by rosbags."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        _rosbags(log, writer, store, store.serialize_cdr, False)
    return next(folder.glob("*.db3"))


def bag(log: Log, path: Path, compression: str = "") -> Path:
    """ROS 1, by rosbags."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    if compression:
        writer.set_compression(getattr(Writer.CompressionFormat, compression))
    with writer:
        _rosbags(log, writer, store, store.serialize_ros1, True)
    return path


def lsf(log: Log, path: Path) -> Path:
    """IMC, by imcpy; packed where the name says so."""
    import gzip

    import imcpy

    run = log.runs[0]
    out = []
    for i, stamp in enumerate(stamps(run)):
        message = imcpy.EstimatedState()
        message.timestamp, message.src = stamp * 1e-9, 30
        message.phi, message.theta, message.psi = map(float, run.euler[i])
        for name, value in zip("uvwpqr", run.nu[i], strict=True):
            setattr(message, name, float(value))
        message.x, message.y, message.depth = map(float, run.position[i])
        message.alt = -1.0
        out.append(message.serialize())
        for k, value in enumerate(run.thrusters[i]):
            command = imcpy.SetThrusterActuation()
            command.timestamp, command.src, command.id, command.value = stamp * 1e-9, 30, k, float(value)
            out.append(command.serialize())
    data = b"".join(out)
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


def _df(number: int, codes: str, values: list[Any]) -> bytes:
    kinds = {
        "Q": "Q",
        "B": "B",
        "H": "H",
        "h": "h",
        "f": "f",
        "d": "d",
        "c": "h",
        "N": "16s",
        "n": "4s",
        "Z": "64s",
    }
    return struct.pack("<BBB" + "".join(kinds[c] for c in codes), 0xA3, 0x95, number, *values)


def binary(log: Log, path: Path, quantised: bool = False) -> Path:
    """DataFlash, put down by hand after ArduPilot's structure: in doubles, or quantised as the firmware has it."""
    run = log.runs[0]
    wide = "f" if quantised else "d"
    formats = {
        10: ("XKQ", "QBffff" if quantised else "QBdddd", "TimeUS,C,Q1,Q2,Q3,Q4"),
        11: ("XKF1", f"QB{wide * 6}", "TimeUS,C,VN,VE,VD,PN,PE,PD"),
        12: ("RATE", f"Q{wide * 3}", "TimeUS,R,P,Y"),
        13: (
            "RCOU",
            "Q" + ("H" if quantised else "d") * 8,
            "TimeUS," + ",".join(f"C{i + 1}" for i in range(8)),
        ),
    }
    sizes = {"Q": 8, "B": 1, "f": 4, "d": 8, "H": 2}
    out = [_df(128, "BBnNZ", [128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"])]
    for number, (name, codes, labels) in formats.items():
        length = 3 + sum(sizes[c] for c in codes)
        out.append(_df(128, "BBnNZ", [number, length, name.encode(), codes.encode(), labels.encode()]))
    velocity = Rotation.from_quat(run.quaternion[:, [1, 2, 3, 0]]).apply(run.nu[:, :3].copy())
    pulse = 1500.0 + 400.0 * run.thrusters
    pulse = np.concatenate([pulse, np.zeros((run.samples, 8 - pulse.shape[1]))], axis=1)
    for i in range(run.samples):
        us = 5_000_000 + round(run.t[i] * 1e6)
        out.append(_df(10, formats[10][1], [us, 0, *run.quaternion[i]]))
        out.append(_df(11, formats[11][1], [us, 0, *velocity[i], *run.position[i]]))
        out.append(_df(12, formats[12][1], [us, *np.degrees(run.nu[i, 3:])]))
        values = [round(v) for v in pulse[i]] if quantised else list(pulse[i])
        out.append(_df(13, formats[13][1], [us, *values]))
    path.write_bytes(b"".join(out))
    return path


def tlog(log: Log, path: Path) -> Path:
    """MAVLink, by pymavlink."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    run = log.runs[0]
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    velocity = Rotation.from_quat(run.quaternion[:, [1, 2, 3, 0]]).apply(run.nu[:, :3].copy())
    pulse = np.full((run.samples, 16), 0)
    pulse[:, : run.thrusters.shape[1]] = np.round(1500.0 + 400.0 * run.thrusters)
    out = []
    for i, stamp in enumerate(stamps(run)):
        ms = round(run.t[i] * 1e3)
        messages = [
            dialect.MAVLink_attitude_quaternion_message(ms, *run.quaternion[i], *run.nu[i, 3:]),
            dialect.MAVLink_local_position_ned_message(ms, *run.position[i], *velocity[i]),
            dialect.MAVLink_servo_output_raw_message(1000 * ms, 0, *map(int, pulse[i])),
        ]
        if i % 20 == 0:
            messages.append(dialect.MAVLink_heartbeat_message(12, 3, 0, 0, 4, 3))
        out += [struct.pack(">Q", stamp // 1000) + m.pack(link) for m in messages]
    path.write_bytes(b"".join(out))
    return path


def ulog(log: Log, path: Path) -> Path:
    """ULog, put down by hand after its specification."""
    run = log.runs[0]
    count = run.thrusters.shape[1]
    formats = [
        "vehicle_odometry:uint64_t timestamp;float[3] position;float[4] q;float[3] velocity;float[3] angular_velocity;"
        "uint8_t velocity_frame;uint8_t pose_frame;",
        "actuator_motors:uint64_t timestamp;float[12] control;",
    ]

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000)]
    out += [message("F", f.encode()) for f in formats]
    for number, name in enumerate(("vehicle_odometry", "actuator_motors")):
        out.append(message("A", struct.pack("<BH", 0, number) + name.encode()))
    for i in range(run.samples):
        us = 1_000_000 + round(run.t[i] * 1e6)
        pose = [*run.position[i], *run.quaternion[i], *run.nu[i]]
        out.append(message("D", struct.pack("<HQ13fBB", 0, us, *pose, 3, 1)))
        control = [*run.thrusters[i], *[np.nan] * (12 - count)]
        out.append(message("D", struct.pack("<HQ12f", 1, us, *control)))
    path.write_bytes(b"".join(out))
    return path


def _arrays(run: Run) -> dict[str, np.ndarray]:
    return {name: np.array(column) for name, column in run.columns()}


def mat5(log: Log, path: Path) -> Path:
    """MATLAB v7, by scipy: plain arrays of canonical names, compressed."""
    from scipy.io import savemat

    savemat(path, _arrays(log.runs[0]), do_compression=True)
    return path


def mat73(log: Log, path: Path) -> Path:
    """MATLAB v7.3, by h5py as MATLAB lays it out: a structure whose arrays are transposed."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("rov")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, column in _arrays(log.runs[0]).items():
            data = group.create_dataset(name, data=column[None, :])
            data.attrs["MATLAB_class"] = np.bytes_("double")
    raw = bytearray(path.read_bytes())
    raw[:128] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    path.write_bytes(raw)
    return path


def netcdf(log: Log, path: Path) -> Path:
    """NetCDF4, by netCDF4."""
    import netCDF4

    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("time", None)
        for name, column in _arrays(log.runs[0]).items():
            variable = file.createVariable(
                "time" if name == "t" else name, "f8", ("time",), fill_value=-9999.0
            )
            variable[:] = np.where(np.isnan(column), -9999.0, column)
    return path


def alog(log: Log, path: Path) -> Path:
    """MOOS: what it knows of a torpedo, one thruster."""
    run = log.runs[0]
    lines = ["%%" + "%" * 40, "%% LOG FILE:       ./MOOSLog.alog", "%% FILE OPENED ON  Thu Jan 1 2026",
             "%% LOGSTART           1767225600.00", "%%" + "%" * 40]  # fmt: skip
    euler = run.euler
    for i in range(run.samples):
        t = f"{run.t[i]:.6f}"
        rows = {"NAV_X": run.position[i, 1], "NAV_Y": run.position[i, 0], "NAV_DEPTH": run.position[i, 2],
                "NAV_HEADING": np.degrees(euler[i, 2]) % 360.0, "NAV_PITCH": euler[i, 1], "NAV_ROLL": euler[i, 0],
                "NAV_SPEED": run.nu[i, 0], "DESIRED_THRUST": 100.0 * run.thrusters[i, 0]}  # fmt: skip
        lines += [
            f"{t}   {name}   pNav   {value!r}" for name, value in ((n, float(v)) for n, v in rows.items())
        ]
        if i % 7 == 0:
            lines.append(f"{t}   APP_STATUS   pNav   all is well, a=1,b=2")
    path.write_text("\n".join(lines) + "\n")
    return path


# Name of the file, writer, and how near each channel comes back.
FORMATS: dict[str, tuple[str, Any, float]] = {
    "mcap": ("log.mcap", mcap, 1e-12), "db3": ("bag", db3, 1e-12), "bag": ("log.bag", bag, 1e-12),
    "dataflash": ("log.BIN", binary, 1e-9), "ulog": ("log.ulg", ulog, 1e-6), "tlog": ("log.tlog", tlog, 2e-3),
    "imc": ("Data.lsf.gz", lsf, 1e-6), "matlab": ("log.mat", mat5, 0.0), "matlab-7.3": ("log73.mat", mat73, 0.0),
    "netcdf": ("log.nc", netcdf, 0.0),
}  # fmt: skip
