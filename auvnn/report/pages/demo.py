"""The page of `demo`: the whole way on one page, from the log to the falling error."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from auvnn.report.page import Page, Plot, draw
from auvnn.report.pages.comparison import ComparisonPage
from auvnn.report.pages.diagnosis import DiagnosisPage
from auvnn.report.pages.improvement import ImprovementPage
from auvnn.report.pages.quality import QualityPage
from auvnn.report.view import View
from auvnn.report.words import finite, interval, listing, number

# Words with which the command begins its lines.
STEPS = ("made", "check", "compare", "where", "diagnose", "add", "floor", "truth")
# Shown at the top of the page, and so left out further down.
FIRST = ("before_after", "waterfall")
PARTS: dict[str, Page] = {
    "quality": QualityPage(),
    "comparison": ComparisonPage(),
    "diagnosis": DiagnosisPage(),
    "improvement": ImprovementPage(without=FIRST),
}
_HEADINGS = {
    "quality": "1. Is the log any good?",
    "comparison": "2. How far off is the model, and where?",
    "diagnosis": "3. What is missing?",
    "improvement": "4. Does adding it help?",
}


class DemoPage(Page):
    """The four answers of the loop, and the story that they tell."""

    kind = "demo"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "The whole way: compare, see where it fails, name what is missing, add it"

    def about(self, view: View) -> str:
        """Return the model."""
        inner = _inner(view, "comparison") or _inner(view, "improvement")
        return inner.text("model") if inner else ""

    def brief(self, view: View) -> list[str]:
        """Return the first sentences of the four answers."""
        out = []
        for name in ("comparison", "diagnosis", "improvement"):
            inner = _inner(view, name)
            if inner is not None:
                out += PARTS[name].brief(inner)[: 1 if name == "comparison" else 2]
        return out + _truth_words(view)

    def warnings(self, view: View) -> list[str]:
        """Return the warnings of the diagnosis and the improvement."""
        inner = [_inner(view, name) for name in ("diagnosis", "improvement")]
        return list(dict.fromkeys(w for v in inner if v is not None for w in v.texts("warnings")))

    def plots(self, view: View) -> list[Plot]:
        """Return the two figures that show the gain."""
        inner = _inner(view, "improvement")
        return [p for p in ImprovementPage().plots(inner) if p.name in FIRST] if inner is not None else []

    def figures(self, answer: Any) -> dict[str, Figure]:
        """Return the gain, the ranking, and where the residual sits."""
        view = View(answer)
        plots = self.planned(view)
        for name, wanted in (("diagnosis", "ranking"), ("comparison", "residual_map")):
            inner = _inner(view, name)
            plots += [p for p in PARTS[name].planned(inner) if p.name == wanted] if inner is not None else []
        return draw(plots).figures or super().figures(answer)

    def story(self, view: View) -> list[str]:
        """Return the lines of the command, the name of the step set apart."""
        lines = [(line, *line.partition(" ")[::2]) for line in view.texts("story")]
        return [
            f"{step.capitalize()}: {rest.strip()}" if step in STEPS else line for line, step, rest in lines
        ]

    def parts(self, view: View) -> list[tuple[Page, Any]]:
        """Return the four answers in the order of the loop."""
        found = [(PARTS[name], _inner(view, name)) for name in PARTS]
        return [(_Named(page), inner) for page, inner in found if inner is not None]


class _Named(Page):
    """A part under the question that it answers."""

    def __init__(self, page: Page) -> None:
        super().__init__(page.without)
        self.kind = page.kind
        self._page = page
        for name in ("about", "brief", "warnings", "plots", "tables", "assumed"):
            setattr(self, name, getattr(page, name))

    def title(self, view: View) -> str:
        """Return the question."""
        return _HEADINGS[self.kind]


def _inner(view: View, name: str) -> View | None:
    answer = view.get(name)
    if answer is None:
        return None
    truth = view.get("truth") or view.get("hidden")
    truth = truth.get("hidden", truth) if hasattr(truth, "get") else None
    return View(answer, truth=truth)


def _truth_words(view: View) -> list[str]:
    inner = _inner(view, "improvement")
    truth = inner.get("truth") if inner is not None else None
    if inner is None or not truth:
        return []
    fitted = inner.mapping("parameters")
    words = []
    for effect, members in truth.items():
        for name, real in members.items():
            entry = (fitted.get(effect) or {}).get(name) or {}
            if finite(entry.get("value")) is not None:
                found = interval(entry["value"], entry.get("std"), str(entry.get("unit") or ""))
                words.append(f"{name} {number(real)} (found {found})")
    real = finite(view.get("true_error"))
    beside = f"; the true model itself errs by {number(real, 2)}" if real is not None else ""
    return [f"What had been hidden: {listing(words)}{beside}."] if words else []


PAGE = DemoPage()
