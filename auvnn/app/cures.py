"""The cures that findings and errors name, as changes of the mapping that a button can make."""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from typing import Any, NotRequired, TypedDict

import yaml

from auvnn.logs.channels import is_canonical

NUMBER = r"[-+]?[0-9.]+(?:e[-+]?[0-9]+)?"
OFFERS = ("Did you mean (mapping file): ", "Mapping: ")


class Button(TypedDict):
    """What can be done about a finding: a label, and the change of the mapping to make or the effect to try."""

    label: str
    change: NotRequired[dict[str, Any]]
    effect: NotRequired[str]


def buttons(where: str, what: str, cure: str) -> list[Button]:
    """Return what can be done about a finding: a label, and the change of the mapping or the effect to try.

    Args:
        where: channel, run or subject of the finding.
        what: the finding.
        cure: its cure in words.

    Returns:
        Entries with `label`, and either `change` (for `changed`) or `effect`.
    """
    found: list[Button] = []

    def offer(label: str, **change: Any) -> None:
        found.append({"label": label, "change": change})

    for turn in re.findall(r"rates: (rad|deg)", cure):
        offer(f"Read rates in {turn}/s", rates=turn)
    for turn in re.findall(r"angles: (rad|deg)", cure):
        offer(f"Read angles in {turn}", angles=turn)
    for order in re.findall(r"quaternion: (wxyz|xyzw)", cure):
        offer(f"Read the quaternion as {', '.join(order)}", quaternion=order)
    if "world: ENU" in cure:
        offer("Read positions and attitude as ENU", world="ENU")
    if "body: ..." in cure:
        offer("Read the body frame as FLU", body="FLU")
    factor = re.search(rf"scale: ({NUMBER})", cure)
    if factor:
        of = re.search(r"scale: \S+ for ([a-z]+(?:, [a-z]+)*(?: and [a-z]+)?)", cure)
        names = re.findall(r"[a-z]+", of[1].replace(" and ", " ")) if of else [where]
        names = [n for n in names if is_canonical(n)]
        if names:
            listed = ", ".join(names)
            offer(f"Multiply {listed} by {float(factor[1]):g}", scale=dict.fromkeys(names, float(factor[1])))
    delay = re.search(rf"([a-z]+): \{{delay: ({NUMBER})\}}", cure)
    if delay:
        before = re.match(r"((?:[a-z]+, )*[a-z]+) are stamped", what)
        names = before[1].split(", ") if before else [delay[1]]
        names = [n for n in names if is_canonical(n)] or [delay[1]]
        offer(
            f"Shift {', '.join(names)} by {float(delay[2]):g} s", delay=dict.fromkeys(names, float(delay[2]))
        )
    for effect in re.findall(r"effect ([a-z_]+)", cure) + re.findall(r"\((velocity_misalignment)\)", cure):
        found.append({"label": f"Try {effect}", "effect": effect})
    return found


def offered(error: str, mapping: dict[str, Any], names: Sequence[str] = ()) -> dict[str, Any] | None:
    """Return the mapping with what an error about columns or units offers to put into it, or None.

    Args:
        error: why a file could not be read.
        mapping: with which it was read.
        names: the file's columns; what is offered for one thruster counts for all.
    """
    text = next((error.split(offer, 1)[1] for offer in OFFERS if offer in error), None)
    if text is None:
        return None
    new, some = copy.deepcopy(mapping), False
    for one in re.split(r";\s+(?=(?:angles|rates|time|quaternion|frame): )", text):
        try:
            read = yaml.safe_load(one)
        except yaml.YAMLError:
            continue
        if not isinstance(read, dict):
            continue
        for name, column in dict(read.pop("columns", None) or {}).items():
            several = (
                [n for n in names if re.fullmatch(r"thruster_[0-9]+", n)]
                if name.startswith("thruster_")
                else []
            )
            for each in several or [name]:
                there = new.setdefault("columns", {}).get(each, {"from": each})
                source = there["from"] if column.get("from") == "..." else column.get("from", each)
                new["columns"][each] = {**there, **column, "from": source}
                some = True
        new.update(read)
        some = some or bool(read)
    return new if some else None


def changed(mapping: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Return a mapping with a cure in it; a scale multiplies and a delay adds to what stands there."""
    new = copy.deepcopy(mapping)
    for key in ("rates", "angles", "quaternion"):
        if key in change:
            new[key] = change[key]
    for key in ("body", "world"):
        if key in change:
            new.setdefault("frame", {})[key] = change[key]
    columns = new.setdefault("columns", {})
    for name, factor in change.get("scale", {}).items():
        column = columns.setdefault(name, {"from": name})
        column["scale"] = column.get("scale", 1.0) * factor
        if "offset" in column:
            column["offset"] *= factor
    for name, delay in change.get("delay", {}).items():
        column = columns.setdefault(name, {"from": name})
        column["delay"] = column.get("delay", 0.0) + delay
    if not columns:
        del new["columns"]
    return new
