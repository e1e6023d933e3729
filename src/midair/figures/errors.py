"""Figures of errors: frames of a drive, trials of a sweep, passes of a correction loop, stages of an error budget."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from midair.evaluate import ALL, OVERALL, TOUCHED, Budget, LaboratoryLoss
from midair.figures.style import STYLE, new_figure, plain_axes
from midair.model import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def error_figure(solution: Solution, *, simulated: bool, published: tuple[float, float] = (0.05, 0.15)) -> Figure:
    """Draw E of every frame that plays; the range that the paper reports for static patterns is shaded."""
    figure = new_figure(8.0, 2.6, simulated=simulated)
    axis = plain_axes(figure.subplots(), x="time (s)", y="E (%)")
    low, high = (100 * value for value in published)
    axis.axhspan(low, high, color=STYLE.band, label=f"paper, static patterns: {low:.0f}–{high:.0f} %")
    plays = np.array([status != "silent" for status in solution.status])
    error = np.where(plays, 100 * solution.error, np.nan)
    axis.plot(solution.drive.time, error, color=STYLE.reproduced, linewidth=0.8, label="this drive")
    # Not scaled to the worst frame: faint frames can have errors of several hundred per cent.
    top = np.nanpercentile(error, 99) if plays.any() else 0
    axis.set_ylim(0, max(20.0, 1.2 * top))
    axis.margins(x=0)
    axis.legend(fontsize=8, frameon=False, loc="upper right")
    return figure


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


def trials_figure(spreads: Sequence[ErrorSpread]) -> Figure:
    """Draw a line per trial: mean, middle 90 % and worst frame in %, with its strength at the right."""
    figure = new_figure(8.0, 1.2 + 0.26 * len(spreads), simulated=True)
    axes = plain_axes(figure.subplots(), x="E (%): mean, middle 90 % of the frames, worst frame")
    top = 100 * max(one.worst for one in spreads) or 1.0
    for row, one in enumerate(spreads):
        axes.plot([100 * one.low, 100 * one.high], [row, row], color=STYLE.reproduced, linewidth=5, alpha=0.3)
        axes.plot(100 * one.middle, row, "o", color=STYLE.reproduced, markersize=5)
        axes.plot(100 * one.worst, row, "|", color=STYLE.ink, markersize=9)
        axes.annotate(f"{one.strength:.3f}", (1.01, row), xycoords=("axes fraction", "data"), fontsize=8, va="center")
    axes.annotate("strength", (1.01, 1.02), xycoords="axes fraction", fontsize=8, va="bottom")
    axes.set_yticks(range(len(spreads)), [one.name for one in spreads])
    axes.set_ylim(len(spreads) - 0.5, -0.5)
    axes.set_xlim(0, 1.04 * top)
    return figure


def passes_figure(series: Sequence[tuple[str, Sequence[float]]], *, simulated: bool) -> Figure:
    """Draw the error of the waveform, ||reproduced - original|| / ||original||, after each pass of each named loop."""
    figure = new_figure(5.4, 3.0, simulated=simulated)
    axis = plain_axes(figure.subplots(), x="pass", y="error of the waveform (%)")
    for (name, errors), colour in zip(series, _colours(len(series)), strict=True):
        axis.plot(
            range(1, len(errors) + 1), [100 * error for error in errors], "o-", color=colour, markersize=4, label=name
        )
    axis.set_ylim(0)
    axis.set_xticks(range(1, 1 + max(len(errors) for _, errors in series)))
    axis.legend(fontsize=8, frameon=False)
    return figure


def _colours(count: int) -> list[str]:
    palette = (STYLE.reproduced, STYLE.before, STYLE.original, "#009e73", "#cc79a7", "#e69f00", "#0072b2")
    return [palette[number % len(palette)] for number in range(count)]


def budget_figure(budgets: Sequence[tuple[str, Budget]]) -> Figure:
    """Draw signal-to-distortion ratio and images after each stage, one row of panels per named budget."""
    simulated = any(each.simulated for _, each in budgets)
    figure = new_figure(8.6, 2.7 * len(budgets) + 0.5, simulated=simulated)
    axes = figure.subplots(len(budgets), 2, squeeze=False, sharex="col")
    for row, (name, each) in zip(axes, budgets, strict=True):
        names = [stage.name for stage in each.stages]
        place = np.arange(len(names))[::-1]
        _waterfall(plain_axes(row[0]), each, place)
        row[0].set_title(f"{name}, strength {each.strength:.2f}", fontsize=9, loc="left", color=STYLE.ink)
        row[0].set_yticks(place, names, fontsize=8)
        _images(plain_axes(row[1]), each, place)
        row[1].set_yticks(place, [""] * len(names))
        for axis in row:
            axis.set_ylim(-0.6, len(names) - 0.4)
    low, high = budgets[0][1].band
    axes[-1, 0].set_xlabel(f"{TOUCHED}, {low:g} to {high:g} Hz (dB)", fontsize=9)
    axes[-1, 1].set_xlabel("images, 530 to 1000 Hz, re the band (dB)", fontsize=9)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3, fontsize=8, frameon=False)
    return figure


def laboratory_figure(found: LaboratoryLoss) -> Figure:
    """Draw the signal-to-distortion ratio that each uncertainty of a laboratory leaves, alone and all together."""
    rows = found.rows()
    figure = new_figure(6.4, 0.28 * len(rows) + 1.0, simulated=True)
    axis = plain_axes(figure.subplots(), x=f"{OVERALL} (dB)")
    for place, (name, _, middle, low, high) in zip(range(len(rows))[::-1], rows, strict=True):
        colour = STYLE.reproduced if name == ALL else STYLE.before
        axis.plot([low, high], [place, place], color=colour, linewidth=5, alpha=0.4, solid_capstyle="butt")
        axis.plot(middle, place, "o", color=colour, markersize=5)
    axis.axvline(found.nominal, color=STYLE.original, linewidth=1)
    names = [f"{name}, {stated}" if stated else name for name, stated, *_ in rows]
    axis.set_yticks(range(len(rows))[::-1], names, fontsize=8)
    return figure


def _waterfall(axis: Axes, budget: Budget, place: np.ndarray, top: float = 60.0) -> None:
    so_far = np.clip([stage.so_far.distortion_ratio for stage in budget.stages], 0, top)
    alone = np.clip([stage.alone.distortion_ratio for stage in budget.stages], 0, top)
    before = np.concatenate([[top], so_far[:-1]])
    axis.barh(place, so_far, height=0.62, color=STYLE.before, label="so far, against the original")
    lost = np.maximum(before - so_far, 0)
    axis.barh(place, lost, left=so_far, height=0.62, color=STYLE.reproduced, alpha=0.3, label="lost in this stage")
    axis.plot(
        alone, place, "o", color=STYLE.original, markersize=4, label=f"the stage alone ({top:g} means {top:g} or more)"
    )
    for y, stage in zip(place, budget.stages, strict=True):
        axis.annotate(f"{stage.so_far.distortion_ratio:.1f}", (0.6, y), va="center", fontsize=7, color=STYLE.ink)
    axis.set_xlim(0, top + 3)


def _images(axis: Axes, budget: Budget, place: np.ndarray, floor: float = -80.0) -> None:
    axis.axvline(-35, color=STYLE.faint, linewidth=1)
    for y, stage in zip(place, budget.stages, strict=True):
        if stage.so_far.images is None:
            axis.annotate("not available", (floor, y), (3, 0), textcoords="offset points", va="center", fontsize=7)
            continue
        value = max(floor, stage.so_far.images)
        axis.barh(y, value - floor, left=floor, height=0.62, color=STYLE.before)
        axis.annotate(f"{value:.0f}", (value, y), (3, 0), textcoords="offset points", va="center", fontsize=7)
    axis.set_xlim(floor, 6)
