"""The columns that a log cannot do without, and what to say when one is missing."""

from __future__ import annotations

from auvnn.errors import InputError
from auvnn.logs.channels import ACCELERATION, EULER, POSITION, QUATERNION, VELOCITY, WRENCH, numbered
from auvnn.logs.readers.base import Table
from auvnn.logs.reading.mapping_file.suggest import actuator_columns, hint
from auvnn.logs.reading.repairs.repair import Repair


def check_required(table: Table, where: str) -> None:
    """Check that time, a command and enough of the motion are there, and no group is incomplete.

    A vehicle without a DVL has no u, v, w, a glider no rates, a tracked vehicle positions alone: what was not measured
    counts as missing throughout. Where one column of a group is there, the others must be.

    Raises:
        InputError: naming every missing column, with the columns of the file that it might be.
    """
    names = table.names
    missing = [n for n in ("t",) if n not in names]
    attitude = _attitude(names)
    groups = [g for g in (VELOCITY[:3], VELOCITY[3:], attitude) if any(n in names for n in g)]
    seen = groups or any(n in names for n in POSITION)
    if not seen or missing:
        groups = [VELOCITY, attitude]  # nothing of it has its name: say all that it might be
    missing += [n for g in groups for n in g if n not in names]
    thrusters = numbered("thruster", names)
    some_wrench = [n for n in WRENCH if n in names]
    if some_wrench:
        missing += [n for n in WRENCH if n not in names]
    if any(n in names for n in ACCELERATION):
        missing += [n for n in ACCELERATION if n not in names]
    commands = actuator_columns(names)
    if missing or not (thrusters or some_wrench):
        raise InputError(_words(missing, bool(thrusters or some_wrench), commands, names, where))
    for kind in ("thruster", "fin"):
        found = numbered(kind, names)
        wanted = [f"{kind}_{i + 1}" for i in range(len(found))]
        if found != wanted:
            gap = next(w for w, f in zip(wanted, found, strict=True) if w != f)
            raise InputError(
                f"{where}: there is {found[-1]} but no {gap}; number them from 1 on, without a gap"
            )
    for name in ("t", *attitude, *VELOCITY, *thrusters, *some_wrench):
        if name in table.text:
            raise InputError(f"{where}: column '{name}' is no column of numbers: {table.text[name].bad}")


def notes(table: Table, where: str) -> list[Repair]:
    """Return notes on columns that are not used as they stand."""
    result = []
    if all(n in table.columns for n in QUATERNION) and any(n in table.names for n in EULER):
        result.append(Repair("both a quaternion and angles: the quaternion is used", where, 1, "info"))
    partial = [n for n in POSITION if n in table.columns]
    if 0 < len(partial) < 3:
        words = f"of the position only {', '.join(partial)} is there; the rest counts as missing"
        result.append(Repair(words, where, 3 - len(partial), "info"))
    if numbered("thruster", table.columns) and WRENCH[0] in table.columns:
        result.append(Repair("both thrusters and a wrench: the thrusters are used", where, 1, "info"))
    for name, text in table.text.items():
        if name != "run":
            result.append(Repair(f"column '{name}' left out: it is no number ({text.bad})", where, 1, "info"))
    return result


def _attitude(names: list[str]) -> tuple[str, ...]:
    """Return the attitude group that is meant: the complete one, else the one with more columns."""
    quaternion, euler = (sum(n in names for n in group) for group in (QUATERNION, EULER))
    if quaternion == 4 or (euler < 3 and quaternion > euler):
        return QUATERNION
    if euler or not quaternion:
        # Neither is there: suggest by whichever the file's own names resemble.
        resembles = " ".join(names).lower()
        if not euler and any(word in resembles for word in ("orientation", "quat")):
            return QUATERNION
    return EULER


def _words(missing: list[str], commanded: bool, commands: list[str], names: list[str], where: str) -> str:
    parts = []
    if missing:
        columns = "column" if len(missing) == 1 else "columns"
        parts.append(f"{columns} {', '.join(missing)} missing")
    wanted = list(missing)
    if not commanded:
        parts.append("no command: neither thruster_1 ... thruster_n nor tau_X ... tau_N")
        wanted += list(WRENCH)
    words = f"{where}: {'; '.join(parts)}. {hint(wanted, names)}"
    if not commanded and commands:
        words += (
            f"; thruster commands may be in {', '.join(commands)}: thruster_1: {{from: {commands[0]}, ...}}"
        )
    return words
