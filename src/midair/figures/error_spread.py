"""Spread of E over the frames of each trial of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from midair.figures.style import Style, new_figure, plain_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorSpread:
    """E of the frames of one trial."""

    name: str
    """Recording and settings."""
    low: float
    """5 % quantile."""
    middle: float
    """Mean."""
    high: float
    """95 % quantile."""
    worst: float
    """Largest value."""
    strength: float
    """Highest peak of its targets relative to a full focus."""


def trials_figure(spreads: Sequence[ErrorSpread], *, style: Style | None = None) -> Figure:
    """Draw a line per trial: mean, middle 90 % and worst frame in %, with its strength at the right."""
    style = style or Style()
    figure = new_figure(8.0, 1.2 + 0.26 * len(spreads), simulated=True, style=style)
    axes = plain_axes(figure.subplots(), style)
    top = 100 * max(one.worst for one in spreads) or 1.0
    for row, one in enumerate(spreads):
        axes.plot([100 * one.low, 100 * one.high], [row, row], color=style.reproduced, linewidth=5, alpha=0.3)
        axes.plot(100 * one.middle, row, "o", color=style.reproduced, markersize=5)
        axes.plot(100 * one.worst, row, "|", color=style.ink, markersize=9)
        axes.annotate(f"{one.strength:.3f}", (1.01, row), xycoords=("axes fraction", "data"), fontsize=8, va="center")
    axes.annotate("strength", (1.01, 1.02), xycoords="axes fraction", fontsize=8, va="bottom")
    axes.set_yticks(range(len(spreads)), [one.name for one in spreads])
    axes.set_ylim(len(spreads) - 0.5, -0.5)
    axes.set_xlim(0, 1.04 * top)
    axes.set_xlabel("E (%): mean, middle 90 % of the frames, worst frame", fontsize=9)
    return figure
