"""Definitions of ROS messages: from the bag, from a folder of `.msg` files, or those that every vehicle uses."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from textwrap import dedent
from typing import Any

from auvnn.errors import InputError, MissingExtra, one_line

_LONGEST = 200_000  # characters of one definition

# Bags of ROS 2 Humble and older in sqlite3 hold no definitions. Those of ROS itself come with rosbags; these are of
# mavros and of marine sensors: the field names and types of the published interfaces.
_MORE = {
    "mavros_msgs/msg/RCOut": """
        std_msgs/Header header
        uint16[] channels
    """,
    "mavros_msgs/msg/RCIn": """
        std_msgs/Header header
        uint8 rssi
        uint16[] channels
    """,
    "mavros_msgs/msg/OverrideRCIn": """
        uint16[18] channels
    """,
    "mavros_msgs/msg/ManualControl": """
        std_msgs/Header header
        float32 x
        float32 y
        float32 z
        float32 r
        uint16 buttons
    """,
    "mavros_msgs/msg/VfrHud": """
        std_msgs/Header header
        float32 airspeed
        float32 groundspeed
        int16 heading
        float32 throttle
        float32 altitude
        float32 climb
    """,
    "mavros_msgs/msg/State": """
        std_msgs/Header header
        bool connected
        bool armed
        bool guided
        bool manual_input
        string mode
        uint8 system_status
    """,
    "marine_acoustic_msgs/msg/Dvl": """
        std_msgs/Header header
        uint8 velocity_mode
        uint8 dvl_type
        geometry_msgs/Vector3 velocity
        float64[9] velocity_covar
        float64 altitude
        geometry_msgs/Vector3 course_gnd
        float64 speed_gnd
        uint8 num_good_beams
        float64 sound_speed
        bool beam_ranges_valid
        bool beam_velocities_valid
        geometry_msgs/Vector3[4] beam_unit_vec
        float64[4] range
        float64[4] range_covar
        float64[4] beam_quality
        float64[4] beam_velocity
        float64[4] beam_velocity_covar
    """,
}


def _typesys() -> Any:
    try:
        from rosbags import typesys
    except ImportError:
        raise MissingExtra("rosbags", "ros", "reading ROS recordings") from None
    return typesys


def parse(text: str, kind: str, idl: bool = False) -> dict[str, Any]:
    """Return the definitions in a text, by message type; nothing of it is executed.

    Args:
        text: a `.msg` definition, with those of the types within it as bags carry them, or IDL.
        kind: type that the first one has.
        idl: whether it is IDL.

    Raises:
        InputError: it is no definition.
    """
    _typesys()
    from rosbags.typesys.base import TypesysError
    from rosbags.typesys.idl import get_types_from_idl
    from rosbags.typesys.msg import get_types_from_msg

    if len(text) > _LONGEST:
        raise InputError(f"the definition of {kind} is longer than {_LONGEST} characters")
    try:
        return dict(get_types_from_idl(text) if idl else get_types_from_msg(text, kind))
    except (
        TypesysError,
        RecursionError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        AssertionError,
        IndexError,
    ) as problem:
        raise InputError(f"the definition of {kind} cannot be read: {one_line(problem, 120)}") from None


@lru_cache(maxsize=1)
def common() -> dict[str, Any]:
    """Return the definitions of ROS 2's own messages and of those that underwater vehicles use beside them."""
    typesys = _typesys()
    # A later distribution keeps the types of the earlier ones that logs hold.
    found = dict(typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).fielddefs)
    for kind, text in _MORE.items():
        found.update(parse(dedent(text).strip() + "\n", kind))
    return found


def of_folder(folder: Path) -> dict[str, Any]:
    """Return the definitions in a folder of `.msg` files; the folder above the file, or above `msg/`, is the package.

    Raises:
        InputError: it is no folder, or a file in it is no definition.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder of .msg files (mapping: definitions)")
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*.msg")):
        package = path.parent.parent.name if path.parent.name == "msg" else path.parent.name
        try:
            found.update(parse(path.read_text("utf-8", "replace"), f"{package}/msg/{path.stem}"))
        except OSError as problem:
            raise InputError(f"{path}: cannot be read: {problem.strerror}") from None
    return found


def known_kinds(kinds: Iterable[str], definitions: dict[str, Any]) -> list[str]:
    """Return those message types whose definition is there, with all types within it."""
    return [k for k in kinds if _complete(k, definitions, set())]


def _complete(kind: str, definitions: dict[str, Any], seen: set[str]) -> bool:
    if kind in seen:
        return True
    if kind not in definitions or len(seen) > 500:
        return False
    seen.add(kind)
    inner = [_named(int(k), d) for _, (k, d) in definitions[kind][1]]
    return all(_complete(n, definitions, seen) for n in inner if n)


def _named(kind: int, description: Any) -> str | None:
    if kind == 2:
        return str(description)
    return _named(int(description[0][0]), description[0][1]) if kind in (3, 4) else None
