"""The quality report: what was read, repaired, implausible and excited, before anything is fitted."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from auvnn.answers import PLOTTED, Answer, plain
from auvnn.cards import Card, figure
from auvnn.errors import InputError
from auvnn.logs.quality import channel_quality, excitation, findings, kinematics, vertical
from auvnn.logs.quality.channel_quality import Channel
from auvnn.logs.quality.excitation import Excitation
from auvnn.logs.quality.findings import Finding
from auvnn.logs.quality.kinematics import Agreement
from auvnn.logs.reading.repairs.repair import LEVELS, Level

if TYPE_CHECKING:
    from auvnn.logs.log import Log


@dataclass(frozen=True, eq=False, repr=False)
class Quality(Answer):
    """What a log is worth.

    Args:
        log: the log.
        channels: by column name.
        findings: what a person should know, errors first.
        kinematics: by velocity component, those that can be compared.
        excitation: by velocity component.
        condition: of [nu, |nu| nu] over the excited components.
        runs: samples, duration, rate, jitter and gaps of every run.
        actuators: what the log says about a model's actuators, where it was asked; plain data.
        files: what the log's files hold, where it was asked: topics, fields, rates, the mapping proposed; plain data.
    """

    kind: ClassVar[str] = "quality"

    log: Log
    channels: dict[str, Channel]
    findings: list[Finding]
    kinematics: dict[str, Agreement]
    excitation: dict[str, Excitation]
    condition: float
    runs: list[dict[str, float]] = field(default_factory=list)
    actuators: dict[str, Any] | None = None
    files: list[dict[str, Any]] | None = None

    def card(self) -> Card:
        """Return what is wrong with the log, and how much each velocity moves."""
        counts = [(len(self.of_level(level)), level) for level in LEVELS]
        told = ", ".join(f"{n} {level}{'' if n == 1 or level == 'info' else 's'}" for n, level in counts if n)
        worst = [f"{f.level}: {f.where}: {f.what}" for f in self.findings if f.level in ("error", "warning")]
        rows = [
            [
                name,
                f"{e.low:.3g} to {e.high:.3g}",
                figure(e.std),
                figure(e.noise_std),
                "yes" if e.excited else "hardly",
            ]
            for name, e in self.excitation.items()
        ]
        head = ("velocity", "range", "standard deviation", "noise", "moves")
        return Card(f"Quality of {self.log.name}", told or "nothing found", worst[:4], head, rows, PLOTTED)

    def with_actuators(self, checked: Any) -> Quality:
        """Return the report with what a check of a model's actuators said, its warnings among the findings."""
        found = [Finding("warning", "actuators", w.removeprefix("actuators: ")) for w in checked.words]
        findings = sorted([*self.findings, *found], key=lambda f: LEVELS.index(f.level))
        return replace(self, findings=findings, actuators=checked.to_dict())

    def with_notes(self, where: str, words: list[str]) -> Quality:
        """Return the report with further findings for information."""
        return replace(self, findings=[*self.findings, *(Finding("info", where, w) for w in words)])

    def of_level(self, level: Level) -> list[Finding]:
        """Return the findings of one level."""
        return [f for f in self.findings if f.level == level]

    @property
    def errors(self) -> list[Finding]:
        """Findings that forbid fitting."""
        return self.of_level("error")

    @property
    def warnings(self) -> list[Finding]:
        """Findings that ask for care."""
        return self.of_level("warning")

    def refuse_errors(self, force: bool = False) -> None:
        """Raise where the log must not be fitted: contradictions, and logs in which nothing moves or is driven.

        Raises:
            InputError: there is a finding of level "error"; the message names the first and its cure.
        """
        if not force:
            self._refuse(self.errors, "; force=true fits it anyway")

    @property
    def contradictions(self) -> list[Finding]:
        """Errors that show the log at odds with itself: signs, units, axes, the order of a quaternion."""
        return [f for f in self.errors if f.where != "excitation"]

    @property
    def reservations(self) -> list[str]:
        """What whoever fits or scores the log should repeat with the result: contradictions, samples left out."""
        return [
            f"{f.where}: {f.what}" for f in self.findings if f in self.contradictions or f.where == "spikes"
        ]

    def refuse_contradictions(self, force: bool = False) -> None:
        """Raise where the log contradicts itself, unless that is to be tolerated.

        What a log merely says too little about is no contradiction: fits name the parameters concerned.

        Raises:
            InputError: with the first contradiction and its cure.
        """
        if not force:
            self._refuse(self.contradictions, "; force=true fits it anyway")

    def _refuse(self, found: list[Finding], way_out: str = "") -> None:
        if found:
            first = found[0]
            more = f" (and {len(found) - 1} more errors)" if len(found) > 1 else ""
            cure = f"; {first.cure}" if first.cure and first.cure not in first.what else ""
            raise InputError(f"log '{self.log.name}': {first.where}: {first.what}{cure}{more}{way_out}")

    @property
    def metrics(self) -> dict[str, float]:
        """Flat named numbers, units in the names."""
        with np.errstate(over="ignore"):
            speed = np.concatenate([np.linalg.norm(run.nu[:, :3], axis=1) for run in self.log.runs])
        valid = sum(int(run.valid.sum()) for run in self.log.runs)
        return {
            "samples": self.log.samples,
            "runs": len(self.log.runs),
            "duration_s": self.log.duration,
            "rate_hz": float(np.median([1.0 / run.dt for run in self.log.runs])),
            "valid_share": valid / self.log.samples,
            "gaps": sum(int(r["gaps"]) for r in self.runs),
            "speed_max_m_s": float(np.nanmax(speed)) if np.isfinite(speed).any() else np.nan,
            "excited_directions": sum(e.excited for e in self.excitation.values()),
            "condition": self.condition,
            "repaired_samples": sum(r.count for r in self.log.repairs if r.level == "repair"),
            **{f"{level}s": len(self.of_level(level)) for level in ("error", "warning", "repair")},
        }

    def to_dict(self) -> dict[str, Any]:
        """Return `quality.json` as plain data."""
        log = self.log
        return plain(
            {
                "schema": "auvnn/quality/1",
                "log": log.name,
                "read": {
                    "files": [str(p) for p in log.paths],
                    "sha256": log.sha256,
                    "columns": log.columns,
                    "unknown_columns": list(log.unknown),
                    "actuation": log.kind,
                },
                "metrics": self.metrics,
                "runs": self.runs,
                "channels": {name: c.to_dict() for name, c in self.channels.items()},
                "findings": [f.to_dict() for f in self.findings],
                "repairs": [r.to_dict() for r in log.repairs],
                "kinematics": {name: a.to_dict() for name, a in self.kinematics.items()},
                **({} if self.actuators is None else {"actuators": self.actuators}),
                **({} if self.files is None else {"files": self.files}),
                "excitation": {
                    "condition": self.condition,
                    "directions": {name: e.to_dict() for name, e in self.excitation.items()},
                },
            }
        )


def assess(log: Log) -> Quality:
    """Judge a log: channels, agreement of rates with attitude, excitation, and findings in plain words."""
    # A simulation that has diverged overflows here, and the report says so by its numbers.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _assess(log)


def _assess(log: Log) -> Quality:
    channels = channel_quality.assess(log)
    agreement = kinematics.check_kinematics(log)
    order = kinematics.attitude_order(log)
    directions, condition = excitation.assess(log, {n: c.noise_std for n, c in channels.items()})
    time = findings.gaps(log)
    runs = [
        {
            "run": run.number,
            "samples": run.samples,
            "duration_s": run.duration,
            "rate_hz": 1.0 / run.dt,
            "jitter": time[run.number][2],
            "gaps": time[run.number][0],
            "longest_step_s": time[run.number][1],
            "valid_share": float(run.valid.mean()),
        }
        for run in log.runs
    ]
    clocks = kinematics.clocks(log, agreement) if order is None else {}
    depth = vertical.check_vertical(log)
    found = findings.collect(log, channels, agreement, directions, order, clocks, depth)
    if log.unsealed:
        few = ", ".join(path.name for path in log.unsealed[:3]) + (", ..." if len(log.unsealed) > 3 else "")
        words = f"no checksum in or next to {few}: damage that leaves numbers readable cannot be seen"
        found.append(Finding("info", "checksum", words, "seal the log as it is: auvnn check seal=true"))
    return Quality(log, channels, found, agreement, directions, condition, runs)
