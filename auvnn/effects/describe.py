"""Effects described for people: equation, parameters, needs, look-alikes, and what to drive to see them."""

from __future__ import annotations

import inspect
import textwrap

from auvnn.effects.base import HOOKS, Effect
from auvnn.vehicle import Vehicle, load_vehicle

# Plausible sizes and bounds depend on the vehicle; the pages state them for this one.
EXAMPLE = "rov95"
HOOK_WORDS = {
    "command": "the commands",
    "delay": "the time at which thrust comes",
    "respond": "how thrust follows its demand",
    "steer": "how fin angles follow their commands",
    "thrust": "the thrust",
    "water": "the motion of the water",
    "flow": "how much of the water's motion everything except the drag feels",
    "body": "mass, buoyancy, centres and damping",
    "wrench": "a further force and moment",
    "sense": "what the sensors report",
}


def describe_effect(kind: type[Effect], vehicle: Vehicle | None = None) -> str:
    """Return one effect as Markdown.

    Args:
        kind: class of the effect.
        vehicle: for which plausible sizes and bounds are stated; a built-in one by default.
    """
    known = load_vehicle(EXAMPLE) if vehicle is None else vehicle
    actuation = "thrusters" if known.thrusters else "wrench"
    lines = [f"## {kind.name}", "", _sentence(kind.cause), "", *_equation(kind), ""]
    lines += ["| parameter | unit | null | plausible size | bounds |", "|---|---|---|---|---|"]
    for p in kind.describe(known, actuation):
        unit = "–" if p.unit == "1" else p.unit
        lines.append(f"| `{p.name}` | {unit} | {p.null:g} | {p.scale:.3g} | {p.low:.4g} to {p.high:.4g} |")
    lines += ["", f"*Changes*: {', '.join(HOOK_WORDS[h] for h in HOOKS if h in kind.hooks())}."]
    if kind.channels:
        lines.append(f"*Needs in the log*: {_names(kind.channels)}.")
    if kind.acts_with:
        lines.append(f"*Acts only beside one of*: {_names(kind.acts_with)}.")
    if kind.excludes:
        lines.append(f"*Not together with*: {_names(kind.excludes)}.")
    if kind.confused_with:
        lines.append(f"*Confused with*: {_names(kind.confused_with)}.")
    if kind.manoeuvre:
        lines.append(f"*To see it, drive*: {kind.told_apart_by} (`excitation={kind.manoeuvre}`).")
    lines.append(f"*Reference*: {kind.reference.rstrip('.')}.")
    return "\n".join(lines) + "\n"


def describe_all(kinds: list[type[Effect]]) -> str:
    """Return the page of all effects as Markdown."""
    head = (
        "# Effects\n\n"
        "An effect is one physical cause. It acts where it acts in nature and vanishes exactly when all its parameters\n"
        "are at their null, so that the question whether it is missing is the same for all of them. Plausible sizes and\n"
        f"bounds depend on the vehicle; those below are for `{EXAMPLE}`. `auvnn effects NAME` prints one of these.\n"
    )
    return "\n".join([head, *(describe_effect(kind) for kind in kinds)])


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:].rstrip(".") + "."


def _equation(kind: type[Effect]) -> list[str]:
    """Return the class's own words without the reference, which has its own line."""
    text = inspect.getdoc(kind) or ""
    kept = [line for line in text.splitlines() if not line.startswith("Reference:")]
    return textwrap.dedent("\n".join(kept)).strip().splitlines()
