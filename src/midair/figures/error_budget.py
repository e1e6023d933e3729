"""An error budget as a waterfall chart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from midair.evaluate import TOUCHED, Budget
from midair.figures.style import Style, new_figure, plain_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def budget_figure(budgets: Sequence[tuple[str, Budget]], *, style: Style | None = None) -> Figure:
    """Draw signal-to-distortion ratio and images after each stage, one row of panels per named budget."""
    style = style or Style()
    simulated = any(each.simulated for _, each in budgets)
    figure = new_figure(8.6, 2.7 * len(budgets) + 0.5, simulated=simulated, style=style)
    axes = figure.subplots(len(budgets), 2, squeeze=False, sharex="col")
    for row, (name, each) in zip(axes, budgets, strict=True):
        names = [stage.name for stage in each.stages]
        place = np.arange(len(names))[::-1]
        _waterfall(plain_axes(row[0], style), each, place, style)
        row[0].set_title(f"{name}, strength {each.strength:.2f}", fontsize=9, loc="left", color=style.ink)
        row[0].set_yticks(place, names, fontsize=8)
        _images(plain_axes(row[1], style), each, place, style)
        row[1].set_yticks(place, [""] * len(names))
        for axis in row:
            axis.set_ylim(-0.6, len(names) - 0.4)
    low, high = budgets[0][1].band
    axes[-1, 0].set_xlabel(f"{TOUCHED}, {low:g} to {high:g} Hz (dB)", fontsize=9)
    axes[-1, 1].set_xlabel("images, 530 to 1000 Hz, re the band (dB)", fontsize=9)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3, fontsize=8, frameon=False)
    return figure


def _waterfall(axis: Axes, budget: Budget, place: np.ndarray, style: Style, top: float = 60.0) -> None:
    so_far = np.clip([stage.so_far.distortion_ratio for stage in budget.stages], 0, top)
    alone = np.clip([stage.alone.distortion_ratio for stage in budget.stages], 0, top)
    before = np.concatenate([[top], so_far[:-1]])
    axis.barh(place, so_far, height=0.62, color=style.before, label="so far, against the original")
    lost = np.maximum(before - so_far, 0)
    axis.barh(place, lost, left=so_far, height=0.62, color=style.reproduced, alpha=0.3, label="lost in this stage")
    axis.plot(
        alone, place, "o", color=style.original, markersize=4, label=f"the stage alone ({top:g} means {top:g} or more)"
    )
    for y, stage in zip(place, budget.stages, strict=True):
        axis.annotate(f"{stage.so_far.distortion_ratio:.1f}", (0.6, y), va="center", fontsize=7, color=style.ink)
    axis.set_xlim(0, top + 3)


def _images(axis: Axes, budget: Budget, place: np.ndarray, style: Style, floor: float = -80.0) -> None:
    axis.axvline(-35, color=style.faint, linewidth=1)
    for y, stage in zip(place, budget.stages, strict=True):
        if stage.so_far.images is None:
            axis.annotate("not available", (floor, y), (3, 0), textcoords="offset points", va="center", fontsize=7)
            continue
        value = max(floor, stage.so_far.images)
        axis.barh(y, value - floor, left=floor, height=0.62, color=style.before)
        axis.annotate(f"{value:.0f}", (value, y), (3, 0), textcoords="offset points", va="center", fontsize=7)
    axis.set_xlim(floor, 6)
