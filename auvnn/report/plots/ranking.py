"""The candidates ranked: what each explains, what it gains on runs it was not fitted on, how sure that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import finite, label, listing, p_value

MOST = 14


@style.styled
def ranking(
    candidates: Sequence[Mapping[str, Any]],
    chosen: Sequence[str] = (),
    *,
    most: int = MOST,
    nearest: Sequence[str] = (),
) -> Figure:
    """Draw the candidates: explained share, which orders them after what was chosen, and the fall of the error left out.

    What was chosen is hatched and bold, what comes nearest in italics; what cannot be told apart is in brackets.

    Args:
        candidates: best first, {effect, p_value, explained (share of one), cv_before, cv_after, cv_std
            (optional: one sigma of the fall), confusable_with: [{effect, similarity}], needs: [channels]}.
        chosen: names of the effects that the verdict names.
        most: how many candidates to draw; those that lack channels are left out first.
        nearest: names that come nearest to a cause without being it; they stand before the others.

    Raises:
        NoData: there is no candidate that could be judged.
    """
    first = [*chosen, *(n for n in nearest if n not in chosen)]
    tried = [c for c in candidates if not c.get("needs")]
    # What the verdict names is drawn, however the others rank.
    tried.sort(key=lambda c: str(c.get("effect", "?")) not in first)
    shown = tried[:most] + [c for c in candidates if c.get("needs")][: max(0, min(4, most - len(tried)))]
    if not tried:
        raise NoData("no candidate could be judged")
    shown = in_order(shown, first)
    figure = style.new_figure(style.PAGE, 0.75 + 0.235 * len(shown))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1, 1])
    names = [str(c.get("effect", "?")) for c in shown]
    for i, candidate in enumerate(shown):
        _row(left, right, i, candidate, names[i] in chosen)
    left.set_yticks(range(len(shown)), [label(name, 30) for name in names])
    for tick, name in zip(left.get_yticklabels(), names, strict=True):
        tick.set_fontweight("bold" if name in chosen else "normal")
        tick.set_fontstyle("italic" if name in nearest and name not in chosen else "normal")
    left.set_ylim(len(shown) - 0.4, -0.6)
    left.set_xlim(0, max(100.0, left.get_xlim()[1]))
    left.set_xlabel("explained share of the residual (%)")
    sure = "; 95 % interval" if any(improvement(c)[1] is not None for c in shown) else ""
    right.set_xlabel(f"fall of the cross-validated error (%{sure})")
    right.axvline(0, color=style.INK, lw=0.6)
    low, high = right.get_xlim()
    room = 0.04 * (max(high, 2) - min(low, -2))
    right.set_xlim(min(low, -2) - room, max(high, 2) + room)
    for ax in (left, right):
        ax.tick_params(axis="y", length=0)
        ax.spines["left"].set_visible(ax is left)
        style.show_grid(ax, "x")
    edge = right.get_yaxis_transform()
    right.text(1.24, -0.75, "p", style="italic", ha="right", va="bottom", transform=edge)
    groups = brackets(shown, chosen)
    for column, group in enumerate(groups):
        _bracket(right, [names.index(name) for name in group], 1.275 + 0.035 * column)
    if groups:
        right.text(1.262, -0.75, "alike", fontsize=7, ha="left", va="bottom", transform=edge)
    return figure


def _row(left: Axes, right: Axes, i: int, candidate: Mapping[str, Any], chosen: bool) -> None:
    look = style.AFTER if chosen else None
    face, hatch = (style.BAR, look.hatch) if look else ("#dddddd", "")
    edge = look.color if look else "#707070"
    lacking = candidate.get("needs")
    if lacking:
        left.text(
            1,
            i,
            f"not judged: the log has no {label(listing(lacking))}",
            va="center",
            fontsize=7.5,
            color="#606060",
        )
        return
    explained = finite(candidate.get("explained"))
    if explained is not None:
        left.barh(i, 100 * explained, height=0.66, fc=face, ec=edge, hatch=hatch)
    else:
        left.text(1, i, "unknown", va="center", fontsize=7.5, color="#606060")
    fall, std = improvement(candidate)
    if fall is not None:
        right.errorbar(
            100 * fall,
            i,
            xerr=None if std is None else 196 * std,
            fmt="s" if chosen else "o",
            color=edge,
            mfc=edge if chosen else "white",
            ms=4.5 if chosen else 4,
            capsize=2,
            lw=1,
        )
    weight = "bold" if chosen else "normal"
    right.text(
        1.24,
        i,
        p_value(candidate.get("p_value")),
        ha="right",
        va="center",
        fontsize=8,
        weight=weight,
        transform=right.get_yaxis_transform(),
    )


def in_order(candidates: Sequence[Mapping[str, Any]], chosen: Sequence[str] = ()) -> list[Mapping[str, Any]]:
    """Return the candidates as they are drawn: what was chosen first, then by the bars; last, what was not judged."""

    def place(candidate: Mapping[str, Any]) -> tuple[bool, int, float]:
        name, explained = str(candidate.get("effect", "?")), finite(candidate.get("explained"))
        at = list(chosen).index(name) if name in chosen else len(chosen)
        return bool(candidate.get("needs")), at, -(explained if explained is not None else -1.0)

    return sorted(candidates, key=place)


def improvement(candidate: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Return the relative fall of the cross-validated error, and its standard deviation where stated."""
    before, after = finite(candidate.get("cv_before")), finite(candidate.get("cv_after"))
    if before is None or after is None or before <= 0:
        return None, None
    std = finite(candidate.get("cv_std"))
    return (before - after) / before, None if std is None else std / before


def brackets(
    candidates: Sequence[Mapping[str, Any]], chosen: Sequence[str] = (), most: int = 3
) -> list[list[str]]:
    """Return the groups that cannot be told apart, each led by its best-ranked member, at most three.

    Only groups that matter: led by an effect that was chosen, or that explains a tenth of what the best does.

    Args:
        candidates: as the answer lists them, best first.
        chosen: effects that were named.
        most: groups at most.
    """
    best = max((e for c in candidates if (e := finite(c.get("explained"))) is not None), default=0.0)
    names = [str(c.get("effect", "?")) for c in candidates]
    seen: set[str] = set()
    groups = []
    for name, candidate in zip(names, candidates, strict=True):
        others = [str(o.get("effect")) for o in candidate.get("confusable_with") or []]
        group = [n for n in names if n == name or n in others]
        matters = name in chosen or (finite(candidate.get("explained")) or 0.0) >= max(0.1 * best, 1e-12)
        if matters and name not in seen and len(group) > 1:
            groups.append(group)
            seen.update(group)
    return groups[:most]


def _bracket(ax: Axes, rows: list[int], x: float) -> None:
    transform = ax.get_yaxis_transform()
    options = {"color": style.INK, "lw": 0.8, "transform": transform, "clip_on": False}
    ax.plot([x, x], [min(rows), max(rows)], **options)
    for row in rows:
        ax.plot([x - 0.015, x], [row, row], **options)
