"""The figures of a log: what was measured and commanded, run by run."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.page import Page, Plot
from auvnn.report.pages.common import THINNED
from auvnn.report.panels import time_series
from auvnn.report.plots.commands_over_time import commands_over_time
from auvnn.report.view import View
from auvnn.report.words import plural

MOST = 6  # runs that are drawn


class LogPage(Page):
    """What a log holds, drawn."""

    kind = "log"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "What was measured"

    def about(self, view: View) -> str:
        """Return the log's name."""
        return str(view.answer.name)

    def brief(self, view: View) -> list[str]:
        """Return how much there is."""
        log = view.answer
        return [f"{plural(log.samples, 'sample')} in {plural(len(log.runs), 'run')}, driven by {log.kind}."]

    def plots(self, view: View) -> list[Plot]:
        """Return velocities, attitude and commands of the first runs."""
        out = []
        for run in view.answer.runs[:MOST]:
            out += [
                Plot(f"run_{run.number}", f"Run {run.number}", lambda run=run: _velocities(run), THINNED),
                Plot(
                    f"run_{run.number}_commands",
                    f"Commands of run {run.number}",
                    lambda run=run: _commands(run),
                    THINNED,
                    folded=True,
                ),
            ]
        return out


@style.styled
def _velocities(run: Any) -> Figure:
    title = f"run {run.number}"
    return time_series(run.t, {"measured": run.nu}, symbols=style.VELOCITY, title=title)


def _commands(run: Any) -> Figure:
    names = [n for n, _ in run.columns() if n.startswith(("thruster_", "tau_", "fin_"))]
    return commands_over_time(run.t, {n: np.asarray(run[n]) for n in names})


PAGE = LogPage()
