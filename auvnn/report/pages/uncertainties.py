"""The page of the study of several uncertainties: what is identified together, what is confounded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.plots.identifiability import identifiability
from auvnn.report.plots.swallowed import swallowed
from auvnn.report.view import View
from auvnn.report.words import finite, number, percent


class UncertaintiesPage(Page):
    """What the study says."""

    kind = "uncertainties"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "Several uncertainties at once"

    def about(self, view: View) -> str:
        """Return model and manoeuvres."""
        return f"{view.text('model', 'a model')}: {', '.join(_manoeuvres(view))}"

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        together, beside, swallow = [], [], []
        for name, one in _manoeuvres(view).items():
            rows = one.get("parameters") or []
            known = sum(p.get("verdict") == "identified" for p in rows)
            together.append(f"{name} {known} of {len(rows)}")
            free = [p for p in rows if p.get("verdict_with_networks") is not None]
            left = sum(p["verdict_with_networks"] == "identified" for p in free)
            beside += [f"{name} {left} of {len(free)}"] if free else []
            shares = [finite(s.get("share")) for s in (one.get("swallowed") or {}).values()]
            most = max((s for s in shares if s is not None), default=None)
            swallow += [] if most is None else [f"{name} {percent(most)}"]
        out = [f"Parameters identified with all uncertain at once: {', '.join(together)}."]
        if beside:
            out.append(f"With networks as damping, of those that are not damping: {', '.join(beside)}.")
        if swallow:
            out.append(f"Most that networks of the velocity absorb of an effect: {', '.join(swallow)}.")
        return out

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        found = _manoeuvres(view)
        shares = {
            f"{m}, {words}": {e: s.get(key) for e, s in one["swallowed"].items()}
            for m, one in found.items()
            if one.get("swallowed")
            for key, words in (("share", "fitted"), ("held_out", "held out"))
        }
        return [
            Plot(
                "swallowed",
                "What networks of the velocity absorb",
                lambda: swallowed(shares),
                "Share of the wrench by which an effect betrays itself that six networks of the paper's size can "
                "be trained to give, from the velocity alone. Near 1 the networks fit whatever is wrong, and "
                "agreement on that manoeuvre says nothing of the damping. Fitted: on the runs that they were trained on; "
                "held out: on other runs of the same manoeuvre (the paper's runs are all alike), where less than "
                "nothing counts as 0.",
            ),
            Plot(
                "identifiability",
                "What can be identified together",
                lambda: identifiability({m: one["parameters"] for m, one in found.items()}),
                "Standard errors from free running under the noise of good sensors, over those beforehand; in "
                "the shaded part the manoeuvre does not even halve them. Between cross and circle lies what the "
                "uncertainties take from one another, between circle and triangle what an unknown law of damping "
                "takes from the rest.",
            ),
        ]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        found = _manoeuvres(view)
        head = ["parameter", *(f"{m}: {c}" for m in found for c in ("together", "with networks"))]
        rows = []
        for k, row in enumerate(next(iter(found.values()), {}).get("parameters", [])):
            cells = []
            for one in found.values():
                p = one["parameters"][k]
                cells += [number(p["together_over_prior"], 2), number(p["with_networks_over_prior"], 2)]
            rows.append([f"{row['effect']} {row['parameter']}", *cells])
        groups = [
            [m, g, percent(shares["own"]), *(percent(shares.get(o)) for o in one["groups"])]
            for m, one in found.items()
            for g, shares in one["groups"].items()
        ]
        names = list(next(iter(found.values()), {}).get("groups", {}))
        pairs = [
            [m, p["first"], p["second"], number(p["correlation"], 3)]
            for m, one in found.items()
            for p in one["confounded_pairs"][:12]
        ]
        return [
            HtmlTable("Standard error over that beforehand", head, rows),
            HtmlTable(
                "How much of each group's information is its own",
                ["manoeuvre", "group", "own", *(f"like {n}" for n in names)],
                groups,
                "Own: left after the other two groups are projected out. Like: what the other group alone imitates.",
                words=2,
            ),
            HtmlTable(
                "Parameters correlated by more than 0.9",
                ["manoeuvre", "one", "other", "correlation"],
                pairs,
                words=3,
            ),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was assumed."""
        return [
            ("Model", view.text("model")),
            ("Beforehand", f"coefficients known to {percent(view.get('prior'))}, one standard deviation"),
            ("Each manoeuvre", f"{number(view.get('seconds'))} s in all"),
            ("Sensors", "velocity 6 mm/s and 3 mrad/s, attitude 3 mrad, heading 8 mrad, depth 1 cm"),
        ]


def _manoeuvres(view: View) -> dict[str, Mapping[str, Any]]:
    return {str(k): v for k, v in view.mapping("manoeuvres").items() if isinstance(v, Mapping)}


PAGE = UncertaintiesPage()
