"""A thruster on the bench through the package's own thruster effects: which of them do its transients show?

    python experiments/t200/run.py DATA [OUT]

DATA is the folder with the T200 records and `static.csv`, OUT where the answers go. Force follows from PWM by the
vendor's static curve, a gain, an offset of the load cell, and the effects that are asked for. Everything is fitted on
two of the three sine records and tested on the third, for each of the three; the square records are tests alone.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.stats import t as student

from auvnn.answers import plain
from auvnn.effects import Moment, effect_class
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

POUND, KGF, NEUTRAL, SPAN = 4.44822, 9.80665, 1500.0, 400.0
VOLTAGE = 16.0  # V: nominal; the records do not say theirs, and the gain takes up what it differs
SINES = tuple(f"T200_Sine_0-10_Hz_{a}_us.csv" for a in ("1600-1900", "1650-1850", "1700-1800"))
SQUARES = tuple(n.replace("Sine", "Square") for n in SINES)
LENGTH, HISTORY = 1.0, 0.3  # s of a window, and of what the actuators remember before it
STATIC = ("thruster_gain",)
CANDIDATES = {
    "static": (),
    "thruster_lag": ("thruster_lag",),
    "actuation_delay": ("actuation_delay",),
    "lag + delay": ("thruster_lag", "actuation_delay"),
    "thruster_deadband": ("thruster_deadband",),
    "thrust_overshoot": ("thrust_overshoot",),
    "lag + overshoot": ("thruster_lag", "thrust_overshoot"),
}
START = {
    "thruster_lag": [0.01],
    "actuation_delay": [0.008],
    "thruster_deadband": [0.03],
    "thrust_overshoot": [0.1, -0.3],
    "thruster_gain": [1.0],
}
LOW = {
    "thruster_lag": [2e-4],
    "actuation_delay": [0.0],
    "thruster_deadband": [0.0],
    "thrust_overshoot": [0.05, -1.0],
}
ITERATIONS = 8


@dataclass(frozen=True)
class Record:
    """One record: t (N,), s; command (N,) in [-1, 1]; force (N,), N."""

    name: str
    t: np.ndarray
    command: np.ndarray
    force: np.ndarray


def read(data: Path, name: str) -> Record:
    """Return a record in SI units."""
    t, pwm, force = np.genfromtxt(data / name, delimiter=",", skip_header=1).T
    return Record(name, t, (pwm - NEUTRAL) / SPAN, POUND * force)


def static_curve(data: Path, voltage: float = VOLTAGE) -> tuple[list[float], list[float]]:
    """Return command and thrust, N, of the vendor's table at a voltage, interpolated between its voltages."""
    table = np.genfromtxt(data / "static.csv", delimiter=",", skip_header=1)
    at = np.unique(table[:, 0])
    low, high = at[at <= voltage].max(), at[at >= voltage].min()
    part = 0.0 if high == low else (voltage - low) / (high - low)
    pwm = np.unique(table[:, 1])
    force = [np.interp(pwm, *table[table[:, 0] == v][:, [1, 4]].T) for v in (low, high)]
    return ((pwm - NEUTRAL) / SPAN).tolist(), (KGF * ((1 - part) * force[0] + part * force[1])).tolist()


def bench(data: Path, effects: tuple[str, ...], straight: bool = False) -> GreyBox:
    """Return a body with this one thruster and these effects; only its actuators are used."""
    command, thrust = ([-1.0, 1.0], [-50.0, 50.0]) if straight else static_curve(data)
    unit = {"position": [0, 0, 0], "direction": [1, 0, 0], "curve": {"command": command, "thrust": thrust}}
    vehicle = plain_vehicle(thrusters=[unit], reference_voltage=VOLTAGE)
    return GreyBox(vehicle, [effect_class(n).build(vehicle, "thrusters") for n in (*STATIC, *effects)])


def force_of(model: GreyBox, command: torch.Tensor, times: torch.Tensor, history: int) -> torch.Tensor:
    """Return the force of the thruster around every row after the history, N, (B, T).

    It is the mean over the steps before and after the row, which unlike the value at the row itself goes on smoothly
    with a delay: commands are held, and so jump between rows.
    """
    drive = model.actuators.drive(command.unsqueeze(-1), times, model.before_thrust, warmup=history - 1)
    means = torch.stack([step[0] for step in drive.mean], dim=-2)
    thrust = 0.5 * (means[..., 1:, :] + means[..., :-1, :])
    still = torch.zeros(6, dtype=torch.float64)
    moment = Moment(times[..., history:], still[:3], torch.eye(3).double(), still, still, still, thrust)
    for effect in model.using("thrust"):
        thrust = effect.thrust(thrust, moment)
    return (thrust @ model.actuators.allocation.mT)[..., 0]


@dataclass(frozen=True)
class Batch:
    """Windows of some records: command and time (B, history + T), force (B, T)."""

    command: torch.Tensor
    times: torch.Tensor
    force: np.ndarray
    history: int


def windows(records: list[Record], early: int = 0) -> Batch:
    """Cut records into windows with history; the first of each has its first sample as history.

    A row's command is held from its time on; with `early=1` from the row before it on.
    """
    command, times, force = [], [], []
    history = rows = 0
    for record in records:
        dt = float(np.median(np.diff(record.t)))
        history, rows = round(HISTORY / dt), round(LENGTH / dt)
        for begin in range(0, len(record.t) - rows + 1, rows):
            index = np.clip(np.arange(begin - history, begin + rows) + early, 0, len(record.t) - 1)
            command.append(record.command[index])
            times.append(dt * np.arange(-history, rows))
            force.append(record.force[begin : begin + rows])
    return Batch(torch.tensor(np.array(command)), torch.tensor(np.array(times)), np.array(force), history)


class Bench:
    """A model of the bench with its parameters as one vector: those of the effects, and the offset last."""

    def __init__(self, data: Path, effects: tuple[str, ...], straight: bool = False) -> None:
        """Start from rough values."""
        self.model = bench(data, effects, straight)
        self.members = self.model.members
        values = [v for e in self.members for v in START[e.name]]
        low = [v for e in self.members for v in LOW.get(e.name, [-np.inf] * len(START[e.name]))]
        self.low = np.array([*low, -np.inf])
        self.names = [f"{e.name}.{p.name}" for e in self.members for p in e.parameters_of] + ["offset_N"]
        self.theta = np.array([*values, 0.0])

    def predict(self, theta: np.ndarray, batch: Batch) -> np.ndarray:
        """Return the force (B, T), N."""
        at = 0
        with torch.no_grad():
            for effect in self.members:
                size = effect.theta.numel()
                effect.theta.copy_(torch.tensor(theta[at : at + size]))
                at += size
            return force_of(self.model, batch.command, batch.times, batch.history).numpy() + theta[-1]

    def fit(self, batch: Batch, iterations: int = ITERATIONS) -> np.ndarray:
        """Fit by Levenberg-Marquardt within bounds; return standard errors from the windows' own sums (sandwich)."""
        theta, damping = self.theta.copy(), 1e-3
        gap = batch.force - self.predict(theta, batch)
        cost = float((gap**2).sum())
        for _ in range(iterations):
            jacobian = self.slope(theta, batch, batch.force - gap)
            square = np.einsum("btk,btl->kl", jacobian, jacobian)
            right = np.einsum("btk,bt->k", jacobian, gap)
            moved = False
            while damping < 1e6:
                # What sits at its bound and is pushed against it stays there.
                free = ~((theta <= self.low) & (right < 0))
                step = np.zeros(len(theta))
                lhs = square[np.ix_(free, free)]
                step[free] = np.linalg.solve(
                    lhs + damping * np.diag(np.diag(lhs) + 1e-12 * lhs.max()), right[free]
                )
                trial = np.maximum(theta + step, self.low)
                trial_gap = batch.force - self.predict(trial, batch)
                trial_cost = float((trial_gap**2).sum())
                if trial_cost < cost:
                    moved = cost - trial_cost > 1e-7 * cost
                    theta, gap, cost, damping = trial, trial_gap, trial_cost, max(damping / 10, 1e-9)
                    break
                damping *= 10
            if not moved:
                break
        self.theta = theta
        jacobian = self.slope(theta, batch, batch.force - gap)
        square = np.linalg.pinv(np.einsum("btk,btl->kl", jacobian, jacobian))
        by_window = np.einsum("btk,bt->bk", jacobian, gap)
        count = len(by_window)
        return np.sqrt(np.diag(square @ (by_window.T @ by_window) @ square) * count / (count - 1))

    def slope(self, theta: np.ndarray, batch: Batch, here: np.ndarray) -> np.ndarray:
        """Return the derivative of the force by each parameter, (B, T, k), by small steps into the interior."""
        # The gain, which is the first, and the offset, which is the last, enter linearly.
        columns = [(here - theta[-1]) / theta[0]]
        for k in range(1, len(theta) - 1):
            moved = theta.copy()
            h = 1e-4 * max(abs(theta[k]), 0.01)
            moved[k] += h
            columns.append((self.predict(moved, batch) - here) / h)
        columns.append(np.ones_like(here))
        return np.stack(columns, axis=-1)


def score(bench_: Bench, batch: Batch) -> dict[str, float]:
    """Return R2 and the root mean square error, N, of a batch."""
    gap = batch.force - bench_.predict(bench_.theta, batch)
    spread = batch.force - batch.force.mean()
    return {"r2": 1.0 - float((gap**2).sum() / (spread**2).sum()), "rmse_N": float(np.sqrt((gap**2).mean()))}


def studied(data: Path, effects: tuple[str, ...], sines: list[Batch], squares: list[Batch]) -> dict:
    """Fit on all sines, and on two of three in turn; test on the one left out and on the squares."""
    whole = Bench(data, effects)
    together = joined(sines)
    std = whole.fit(together)
    left = []
    for k in range(len(sines)):
        # From the fit on all of them it is a short way: how long a search begins elsewhere decides nothing.
        others = Bench(data, effects)
        others.theta = whole.theta.copy()
        others.fit(joined([s for i, s in enumerate(sines) if i != k]), iterations=4)
        parameters = dict(zip(others.names, others.theta, strict=True))
        left.append({"record": SINES[k], **score(others, sines[k]), "parameters": parameters})
    half = student.ppf(0.975, len(together.force) - 1) * std
    parameters = {
        n: {"value": v, "low": v - h, "high": v + h}
        for n, v, h in zip(whole.names, whole.theta, half, strict=True)
    }
    return {
        "parameters": parameters,
        "fitted": score(whole, together),
        "left_out": left,
        "left_out_r2": float(np.mean([x["r2"] for x in left])),
        "squares": [{"record": n, **score(whole, s)} for n, s in zip(SQUARES, squares, strict=True)],
    }


def joined(batches: list[Batch]) -> Batch:
    """Return several batches as one."""
    return Batch(
        torch.cat([b.command for b in batches]),
        torch.cat([b.times for b in batches]),
        np.concatenate([b.force for b in batches]),
        batches[0].history,
    )


def ringing(bench_: Bench, squares: list[Batch]) -> float:
    """Return the frequency at which the squares' residual is strongest above the drive's 10 Hz, Hz."""
    total: np.ndarray | float = 0.0
    dt = 0.002
    for batch in squares:
        gap = batch.force - bench_.predict(bench_.theta, batch)
        dt = float(batch.times[0, 1] - batch.times[0, 0])
        total = total + (np.abs(np.fft.rfft(gap * np.hanning(gap.shape[1]), axis=1)) ** 2).mean(0)
    frequency = np.fft.rfftfreq(squares[0].force.shape[1], dt)
    high = frequency > 15.0
    return float(frequency[high][np.argmax(np.asarray(total)[high])])


def conventions(data: Path) -> dict[str, float]:
    """Return the time constant of the lag, s, by what is taken for granted: the curve, and when a row begins to act."""
    found = {}
    for curve, straight in (("vendor's curve", False), ("straight line", True)):
        for acts, early in (("from its row on", 0), ("from the row before on", 1)):
            fitted = Bench(data, CANDIDATES["thruster_lag"], straight)
            fitted.fit(windows([read(data, n) for n in SINES], early))
            found[f"{curve}, a command acts {acts}"] = float(fitted.theta[1])
    return found


def main() -> None:
    """Fit all candidates and write `result.json`, and the figure."""
    torch.set_num_threads(1)
    if len(sys.argv) < 2 or not (Path(sys.argv[1]) / SINES[0]).is_file():
        print("skipped: the T200 records are not here; give the folder that holds them")
        return
    data, out = Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "outputs/t200")
    out.mkdir(parents=True, exist_ok=True)
    sines = [windows([read(data, n)]) for n in SINES]
    squares = [windows([read(data, n)]) for n in SQUARES]
    began, result = time.monotonic(), {}
    for name, effects in CANDIDATES.items():
        result[name] = studied(data, effects, sines, squares)
        told = ", ".join(
            f"{n.split('.')[-1]} {p['value']:.4g} ({p['low']:.4g} to {p['high']:.4g})"
            for n, p in result[name]["parameters"].items()
        )
        print(
            f"{name:<18} R2 fitted {result[name]['fitted']['r2']:.4f}, left out {result[name]['left_out_r2']:.4f}, "
            f"squares {np.mean([s['r2'] for s in result[name]['squares']]):.3f}; {told} "
            f"[{time.monotonic() - began:.0f} s]",
            flush=True,
        )
        (out / "result.json").write_text(json.dumps(plain(result), indent=1), encoding="utf-8")
    lag = Bench(data, CANDIDATES["thruster_lag"])
    lag.theta = np.array([p["value"] for p in result["thruster_lag"]["parameters"].values()])
    result["squares' own fit"] = own = {}
    for name in ("thruster_lag", "lag + delay"):
        fitted = Bench(data, CANDIDATES[name])
        std = fitted.fit(joined(squares))
        own[name] = {
            **score(fitted, joined(squares)),
            "parameters": dict(zip(fitted.names, fitted.theta, strict=True)),
            "std": dict(zip(fitted.names, std, strict=True)),
        }
    result["lag by convention"] = conventions(data)
    result["ringing_Hz"] = ringing(lag, squares)
    print(
        "time constant by convention, ms:",
        {n: round(1e3 * v, 1) for n, v in result["lag by convention"].items()},
    )
    print(
        "squares' own fit:",
        {n: round(v["r2"], 3) for n, v in own.items()},
        "ringing",
        result["ringing_Hz"],
        "Hz",
    )
    (out / "result.json").write_text(json.dumps(plain(result), indent=1), encoding="utf-8")
    from figure import draw

    draw(data, result, out / "t200.png")


if __name__ == "__main__":
    main()
