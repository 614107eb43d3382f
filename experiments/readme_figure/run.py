"""Draw the README's picture: free running before and after the missing current was added, and the error at each step.

    python experiments/readme_figure/run.py [OUT]

OUT is auvnn/docs/loop.svg by default.
"""

from __future__ import annotations

import re
import sys
from functools import partial
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

import auvnn
from auvnn.metrics.free_run import initial_states, predict
from auvnn.metrics.windows import cut_windows

mpl.use("svg")
mpl.rcParams |= {"svg.hashsalt": "auvnn", "svg.fonttype": "none", "font.family": "sans-serif"}

ROOT = Path(__file__).resolve().parents[2]
HORIZON = 5.0
BEFORE, AFTER, MEASURED, FLOOR = "#c44e52", "#2f6db3", "#333333", "#888888"


def free_runs(model, windows):
    """Return times and surge speeds of the free runs over windows, one list for each."""
    _, nu = predict(model, windows, initial_states(model, windows))
    times = windows.times[:, windows.warmup :].numpy()
    return [(t[:n], v[:n, 0].detach().numpy()) for t, v, n in zip(times, nu, windows.length, strict=True)]


def main(out: Path) -> None:
    """Make the log, go round the loop, draw."""
    model = auvnn.load("rov95")
    hidden = {"ocean_current": {"v_north": 0.15, "v_east": -0.1}}
    made = auvnn.simulate(
        model, "survey", "realistic", hidden, seed=3, runs=4, duration=60.0, plant="numpy", max_step=0.025
    )
    *fitted, last = [run.number for run in made.log.runs]
    log, held = made.log.select(fitted), made.log.select(last)
    found = auvnn.diagnose(model, log, advice=False, whiteness=False)
    better = auvnn.add(model, log, found.missing, test=held)
    windows = cut_windows(held, HORIZON)
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(9.2, 3.1), width_ratios=(1.7, 1), layout="constrained"
    )
    run = held.runs[0]
    shown = run.t <= 40.0
    left.plot(run.t[shown][::5], run.nu[shown, 0][::5], ".", color=MEASURED, ms=2, label="measured")
    for which, color, words in ((model, BEFORE, "model as given"), (better.model, AFTER, "with the current")):
        for number, (t, u) in enumerate(free_runs(which, windows)):
            if t[-1] <= 40.0:
                left.plot(t[::5], u[::5], color=color, lw=1.6, label=words if number == 0 else None)
    left.set(xlabel="time in s", ylabel="surge speed u in m/s", title="Free running, restarted every 5 s")
    left.legend(frameon=False, fontsize=8, ncols=3)
    steps = better.waterfall
    names = [s["step"].replace("_", " ") for s in steps if s["step"] != "noise floor"]
    values = [s["error"] for s in steps if s["step"] != "noise floor"]
    floor = next(s["error"] for s in steps if s["step"] == "noise floor")
    right.bar(range(len(values)), values, color=[BEFORE] * (len(values) - 1) + [AFTER], width=0.6)
    for place, value in enumerate(values):
        right.annotate(f"{value:.3f}", (place, max(value, floor)), ha="center", va="bottom", fontsize=8)
    right.axhline(floor, color=FLOOR, ls="--", lw=1)
    right.annotate(
        "noise floor", (len(values) - 0.62, floor), color=FLOOR, fontsize=8, va="bottom", ha="left"
    )
    right.set_xlim(-0.5, len(values) + 0.2)
    right.set_xticks(range(len(values)), [n.replace(" ", "\n") for n in names], fontsize=8)
    right.set(
        title="Held-out error over 5 s", ylabel="error / standard deviation", ylim=(0, 1.15 * max(values))
    )
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(out, metadata={"Date": None, "Creator": None})
    # A hundredth of a point is enough for a line; words stay as they are.
    shorter = partial(re.sub, r"(\d+\.\d{2})\d+", r"\1")
    text = re.sub(r' d="[^"]*"', lambda found: shorter(found[0]), out.read_text(encoding="utf-8"))
    out.write_text(text, encoding="utf-8")
    print(
        f"{out}: {len(text.encode()) / 1e3:.0f} kB; missing: {', '.join(found.missing)}; errors {np.round(values, 4)}"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "auvnn" / "docs" / "loop.svg")
