"""Answers with made-up data, of the shapes that the verbs give, for the pages to draw."""

from __future__ import annotations

import importlib
from types import SimpleNamespace

import numpy as np

from auvnn.report.page import Page
from tests.report.fake_signals import AXES, CHANNELS, Fake, drift, motion, one_step, regimes, rollout, times


def comparison(n: int = 4000, runs: int = 2, name: str = "rov95", **other) -> Fake:
    series = []
    for run in range(runs):
        t = times(n)
        nu = motion(t, run)
        model = nu + drift(t, 1.0 + run)
        model[: min(100, n // 4)] = np.nan
        series.append(
            {
                "run": run + 1,
                "t": t,
                "measured": nu,
                "model": model,
                "measured_acc": np.gradient(nu, 0.05, axis=0),
                "model_acc": np.gradient(nu, 0.05, axis=0) + 0.01,
                "residual": 20 * drift(t, 1.0) + np.random.default_rng(run).standard_normal((n, 6)),
            }
        )
    answer = Fake(
        schema="auvnn/comparison/1",
        model=name,
        log="dive-1",
        samples=n * runs,
        runs=runs,
        derivative={"method": "local polynomial, order 2, 9 samples", "bandwidth_hz": 1.7},
        one_step=one_step(1.0),
        rollout=rollout(1.0),
        residual_wrench={
            a: {"rms": 12.0 - i, "mean": 1.5, "noise_floor": 2.0 if i < 3 else 0.3}
            for i, a in enumerate(AXES)
        },
        failures=[
            {"channel": "Y", "where": "heading -1.6 to 0 rad", "share": 0.42},
            {"channel": "X", "where": "heading 0 to 1.6 rad", "share": 0.31},
        ],
        series=series,
        regimes=regimes(),
        noise_floor=np.array([2, 2, 2, 0.3, 0.3, 0.3]),
        quality=None,
    )
    answer.json = (
        "schema",
        "model",
        "log",
        "samples",
        "runs",
        "derivative",
        "one_step",
        "rollout",
        "residual_wrench",
        "failures",
    )
    answer.__dict__.update(other)
    return answer


NAMES = [
    "ocean_current", "constant_force", "velocity_lever_arm", "net_buoyancy", "cg_offset", "thruster_gain",
    "thruster_lag", "added_mass", "linear_damping", "quadratic_damping",
]  # fmt: skip


def candidates() -> list[dict]:
    out = []
    for i, name in enumerate(NAMES):
        share = 0.86 * np.exp(-0.5 * i)
        out.append(
            {
                "effect": name,
                "p_value": float(10.0 ** (4 * i - 30)) if i < 7 else 0.3,
                "explained": share,
                "cv_before": 1.0,
                "cv_after": 1 - 0.8 * share + 0.03 * (i > 5),
                "cv_std": 0.02 + 0.01 * i,
                "parameters": {"value": {"value": 0.2 / (i + 1), "std": 0.01, "unit": "N"}},
                "confusable_with": [],
                "needs": [],
            }
        )
    out[0]["parameters"] = {
        "v_north": {"value": 0.2031, "std": 0.0042, "unit": "m/s"},
        "v_east": {"value": -0.098, "std": 0.0051, "unit": "m/s"},
    }
    out[0]["confusable_with"] = [{"effect": "constant_force", "similarity": 0.97}]
    lacking = {
        "effect": "bottom_proximity",
        "p_value": None,
        "explained": None,
        "cv_before": None,
        "cv_after": None,
    }
    out.append({**lacking, "parameters": {}, "confusable_with": [], "needs": ["altitude"]})
    return out


def similarity_table(n: int = 10) -> np.ndarray:
    table = np.abs(np.corrcoef(np.random.default_rng(0).standard_normal((n, 5))))
    table[0, 1] = table[1, 0] = 0.97
    return table


def diagnosis(verdict: str = "named", **other) -> Fake:
    missing = {"named": ["ocean_current"], "ambiguous": ["ocean_current", "constant_force"]}.get(verdict, [])
    answer = Fake(
        schema="auvnn/diagnosis/1",
        model="rov95",
        log="dive-1",
        derivative={"method": "local polynomial", "bandwidth_hz": 1.7},
        verdict=verdict,
        missing=missing,
        steps=[{"verdict": verdict, "effects": missing}, {"verdict": "adequate", "effects": []}],
        candidates=candidates(),
        unexplained=0.04,
        depends_on={a: {"u": 0.1 * i, "heading": 0.3} for i, a in enumerate(AXES)},
        next_experiment={
            "words": "Drive a square at constant depth",
            "manoeuvre": "square",
            "separates": missing,
        },
        warnings=["The neural damping may have absorbed part of what is not damping."],
        similarity=(NAMES, similarity_table()),
        story=["The residual stands out in Y.", "It turns with the heading.", "A current explains it."],
    )
    answer.json = tuple(k for k in vars(answer) if k not in ("json", "similarity", "story"))
    answer.__dict__.update(other)
    return answer


def improvement(n: int = 4000, runs: int = 2, accepted: bool = True, **other) -> Fake:
    series = []
    for run in range(runs):
        t = times(n)
        nu = motion(t, run)
        stages = {"before": nu + drift(t, 1.0), "refitted": nu + drift(t, 0.6), "after": nu + drift(t, 0.05)}
        series.append({"run": run + 5, "t": t, "measured": nu, **stages})
    answer = Fake(
        schema="auvnn/improvement/1",
        model="rov95",
        log="dive-1",
        test="run 5 and 6 of dive-1",
        effects=["ocean_current"],
        accepted=accepted,
        before={"one_step": one_step(1.0), "rollout": rollout(1.0)},
        refitted={"one_step": one_step(0.8), "rollout": rollout(0.8)},
        after={"one_step": one_step(0.2), "rollout": rollout(0.2)},
        gain={"value": 0.156 if accepted else -0.01, "std": 0.012},
        waterfall=[
            {"step": "as given", "error": 0.26},
            {"step": "coefficients refitted", "error": 0.208},
            {"step": "ocean_current", "error": 0.052},
            {"step": "noise floor", "error": 0.04},
        ],
        parameters={"ocean_current": candidates()[0]["parameters"]},
        series=series,
        warnings=[],
    )
    answer.json = tuple(k for k in vars(answer) if k not in ("json", "series"))
    answer.__dict__.update(other)
    return answer


class FakeRun:
    """A run as the quality page uses it: a number, times and columns."""

    def __init__(self, number: int, n: int) -> None:
        self.number, self.t = number, times(n)
        if number == 2:
            self.t = self.t + 40.0 * (self.t > self.t[n // 2])
        self._columns = {c: motion(self.t, number)[:, i] for i, c in enumerate(CHANNELS)}
        self._columns["u"][n // 8 : n // 4] = np.nan
        self._columns |= {c: np.ones(n) for c in ("qw", "qx", "qy", "qz", "x", "y", "z")}
        self._columns |= {f"thruster_{i + 1}": np.zeros(n) for i in range(8)}
        self._columns["voltage"] = np.where(np.arange(n) % 2, 15.0, np.nan)

    def columns(self):
        yield "t", self.t
        yield from self._columns.items()


def quality(n: int = 4000, runs: int = 3, **other) -> Fake:
    answer = Fake(
        schema="auvnn/quality/1",
        log=SimpleNamespace(name="dive-1", runs=[FakeRun(i + 1, n) for i in range(runs)]),
        read={
            "files": ["dive-1.csv"],
            "sha256": "ab" * 32,
            "columns": ["run", "t", *CHANNELS, "voltage"],
            "unknown_columns": ["gps_fix"],
            "actuation": "thrusters",
        },
        metrics={
            "samples": n * runs,
            "runs": runs,
            "duration_s": 0.05 * n * runs,
            "rate_hz": 20.0,
            "valid_share": 0.87,
            "gaps": 1,
        },
        runs=[
            {
                "run": i + 1,
                "samples": n,
                "duration_s": 0.05 * n,
                "rate_hz": 20.0,
                "gaps": int(i == 1),
                "longest_step_s": 40.0 if i == 1 else 0.05,
                "valid_share": 0.87,
            }
            for i in range(runs)
        ],
        channels={
            c: {
                "unit": "m/s" if i < 3 else "rad/s",
                "missing_share": 0.13 if c == "u" else 0.0,
                "std": 0.3,
                "min": -0.9,
                "max": 0.8,
                "noise_std": 0.004,
                "frozen_share": 0.0,
                "repeated_share": 0.01,
                "spikes": 3,
            }
            for i, c in enumerate(CHANNELS)
        },
        findings=[
            {
                "level": "warning",
                "where": "p",
                "what": "p has the opposite sign of the attitude's derivative",
                "cure": "scale: -1 in the mapping",
            },
            {
                "level": "repair",
                "where": "dive-1.csv",
                "what": "duplicate stamps were dropped (4)",
                "cure": "",
            },
            {"level": "info", "where": "columns", "what": "kept but not used: gps_fix", "cure": ""},
        ],
        kinematics={
            c: {"scale": s, "correlation": 0.97, "lag_s": 0.02, "verdict": "agrees" if s > 0 else "reversed"}
            for c, s in zip(CHANNELS, (1.01, 0.99, 1.02, -0.97, -0.98, 1.0), strict=True)
        },
        excitation={
            "condition": 12.0,
            "directions": {
                c: {"std": s, "noise_std": 0.004, "signal_to_noise": s / 0.004, "excited": s > 0.012}
                for c, s in zip(CHANNELS, (0.4, 0.1, 0.05, 0.006, 0.02, 0.3), strict=True)
            },
        },
    )
    answer.json = tuple(k for k in vars(answer) if k not in ("json", "log"))
    answer.__dict__.update(other)
    return answer


def training(**other) -> Fake:
    k = np.arange(150)
    nu = np.linspace(-1.5, 1.5, 200)
    answer = Fake(
        schema="auvnn/training/1",
        model="rov95",
        log="dive-1",
        test="run 3",
        scheme="least_squares",
        history={
            "train": list(0.8 * np.exp(-k / 25) + 0.05),
            "held_out": list(0.8 * np.exp(-k / 25) + 0.07 + 2e-4 * k),
        },
        metrics={"held_out_rmse_m_s2": 0.0123, "parameters": 396, "seconds_s": 3.2},
        surfaces={
            c: {
                "nu": nu,
                "learned": 20 * nu + 40 * nu * np.abs(nu) + 3 * np.sin(4 * nu),
                "nominal": 18 * nu + 38 * nu * np.abs(nu),
                "covered": (-0.9, 1.1),
            }
            for c in CHANNELS
        },
    )
    answer.json = tuple(k for k in vars(answer) if k not in ("json", "surfaces"))
    answer.__dict__.update(other)
    return answer


def demo(n: int = 4000, **other) -> Fake:
    answer = Fake(
        schema="auvnn/demo/1",
        quality=quality(n),
        comparison=comparison(n),
        diagnosis=diagnosis(),
        improvement=improvement(n),
        story=["error over 5 s before: 0.26", "it fails in Y, with the heading", "missing: ocean_current"],
        truth={"hidden": {"ocean_current": {"v_north": 0.2, "v_east": -0.1}}},
    )
    answer.json = ("schema", "story")
    answer.__dict__.update(other)
    return answer


KINDS = ("quality", "comparison", "diagnosis", "improvement", "training", "demo")


def make(kind: str, n: int = 300, runs: int = 2) -> Fake:
    """Return an answer of any kind with `n` samples in each of its runs."""
    sized = {"quality": quality, "comparison": comparison, "improvement": improvement}
    if kind in sized:
        return sized[kind](n, runs)
    return {"diagnosis": diagnosis, "training": training, "demo": lambda: demo(n)}[kind]()


def drawer(kind: str) -> Page:
    """Return what draws the page of a kind of answer."""
    return importlib.import_module(f"auvnn.report.pages.{kind}").PAGE
