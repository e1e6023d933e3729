"""The paper's figures 3, 4 and 9, those of sweeps over patterns (E, E over height), and those of errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.array_types import Array
from midair.evaluate import TOUCHED, Budget
from midair.figures.maps import draw_map
from midair.figures.style import STYLE, colour_bar, label_axes, legend_above, new_figure, plain_axes
from midair.model import ControlGrid, PressureFrames, SensorGrid, Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def histogram_figure(errors: Sequence[tuple[str, Array]], *, published: tuple[float, float]) -> Figure:
    """Draw the distribution of E over the patterns of each named condition.

    The range `published` of the average E that the paper reports is shaded.
    """
    figure = new_figure(7.0, 3.0, simulated=True)
    axes = plain_axes(figure.subplots(), x="E (%)", y="patterns")
    axes.axvspan(100 * published[0], 100 * published[1], color=STYLE.band, zorder=0, label="paper, average")
    top = 100 * max(float(values.max()) for _, values in errors)
    bins = np.linspace(0, top, 121).tolist()
    for (name, values), colour in zip(errors, cycle(STYLE.lines), strict=False):
        label = f"{name}: mean {100 * values.mean():.1f} %, worst {100 * values.max():.1f} %, {len(values)} patterns"
        axes.hist(100 * values, bins=bins, histtype="stepfilled", color=colour, alpha=0.35)
        axes.hist(100 * values, bins=bins, histtype="step", color=colour, linewidth=1.1, label=label)
    axes.set_xlim(0, max(top, 100 * published[1]) * 1.02)
    # Space for the legend.
    axes.set_ylim(0, axes.get_ylim()[1] * 1.3)
    axes.legend(fontsize=8, frameon=False, loc="upper right")
    return figure


def curve_figure(
    curves: Mapping[str, Sequence[Mapping[str, float]]], key: str, *, published: tuple[float, float]
) -> Figure:
    """Draw mean E of the rows of a report over their `key` ("strength", "height_mm"); shaded: the middle 90 %."""
    figure = new_figure(5.2, 3.2, simulated=True)
    quantity = {"strength": "strength (of a single focus)", "height_mm": "height (mm)"}[key]
    axes = plain_axes(figure.subplots(), x=quantity, y="E (%)")
    axes.axhspan(100 * published[0], 100 * published[1], color=STYLE.band, zorder=0, label="paper, average")
    for (name, rows), colour in zip(curves.items(), cycle(STYLE.lines), strict=False):
        x, mean, low, high = (np.array([row[part] for row in rows]) for part in (key, "mean", "p5", "p95"))
        axes.fill_between(x, 100 * low, 100 * high, color=colour, alpha=0.18, linewidth=0)
        axes.plot(x, 100 * mean, "o-", color=colour, markersize=3.5, linewidth=1.2, label=name)
    axes.set_ylim(0, None)
    axes.legend(fontsize=8, frameon=False, loc="upper left")
    return figure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldRow:
    """A row of maps."""

    name: str
    fields: Array
    """Magnitudes, shape (map, point)."""
    grid: ControlGrid
    notes: tuple[str, ...]
    """Title of each map."""


def fields_figure(rows: Sequence[FieldRow], sensor: SensorGrid, *, quantity: str) -> Figure:
    """Draw rows of maps on one scale; white circles are the channels, as in the paper's Fig. 3."""
    count = len(rows[0].notes)
    figure = new_figure(1.85 * count + 1.2, 2.05 * len(rows) + 0.3, simulated=True)
    axes = figure.subplots(len(rows), count, sharex=True, sharey=True, squeeze=False)
    top = max(float(row.fields.max()) for row in rows)
    for line, row in zip(axes, rows, strict=True):
        for axis, values, note in zip(line, row.fields, row.notes, strict=True):
            draw_map(axis, values, row.grid, top, title=note, row=row.name, sensor=sensor, size=7)
    colour_bar(figure, axes.ravel().tolist(), quantity)
    return figure


def stimuli_figure(
    stimuli: Mapping[str, Mapping[str, PressureFrames]], *, channels: Sequence[int] = (0, 15), shown: float = 0.08
) -> Figure:
    """Draw rms map and traces of each stimulus (column pairs), for the original and each mode (rows).

    `stimuli` holds for each stimulus the original and the re-recording of each reproduction, by name. Two channels are
    drawn in black, solid and dotted, the others in grey, as in the paper's Fig. 4; traces are `shown` seconds long.
    """
    rows = list(next(iter(stimuli.values())))
    simulated = any(one.provenance.simulated for each in stimuli.values() for one in each.values())
    figure = new_figure(4.4 * len(stimuli) + 0.4, 2.0 * len(rows) + 0.4, simulated=simulated)
    axes = figure.subplots(len(rows), 2 * len(stimuli), squeeze=False, width_ratios=[1, 1.7] * len(stimuli))
    for column, (stimulus, each) in enumerate(stimuli.items()):
        top = max(float(np.sqrt((one.pressure**2).mean(axis=0)).max()) for one in each.values())
        high = max(float(np.abs(one.pressure).max()) for one in each.values())
        for row, name in enumerate(rows):
            place, time_label = axes[row, 2 * column], "time (ms)" if row == len(rows) - 1 else ""
            wave = plain_axes(axes[row, 2 * column + 1], x=time_label, y="pressure (Pa)")
            place.imshow(np.sqrt((each[name].pressure ** 2).mean(axis=0)), cmap=STYLE.quantity, vmin=0, vmax=top)
            place.set_xticks([])
            place.set_yticks([])
            title = f"{stimulus}, rms 0 to {top:.0f} Pa" if row == 0 else ""
            label_axes(place, title=title, y=name if column == 0 else "")
            frames = each[name]
            count = min(frames.frames, round(shown * frames.rate))
            first = (frames.frames - count) // 2
            time = 1e3 * np.arange(count) / frames.rate
            signals = frames.pressure[first : first + count].reshape(count, -1)
            wave.plot(time, np.delete(signals, list(channels), axis=1), color="#9aa4ae", linewidth=0.6)
            for channel, line in zip(channels, ("-", ":"), strict=False):
                wave.plot(time, signals[:, channel], line, color=STYLE.ink, linewidth=1.1)
            wave.margins(x=0)
            wave.set_ylim(-1.05 * high, 1.05 * high)
    return figure


def error_figure(solution: Solution, *, simulated: bool, published: tuple[float, float] = (0.05, 0.15)) -> Figure:
    """Draw E of every frame that plays; the range that the paper reports for static patterns is shaded."""
    figure = new_figure(8.0, 2.6, simulated=simulated)
    axis = plain_axes(figure.subplots(), x="time (s)", y="E (%)")
    low, high = (100 * value for value in published)
    axis.axhspan(low, high, color=STYLE.band, label=f"paper, static patterns: {low:.0f}–{high:.0f} %")
    error = np.where(solution.plays, 100 * solution.error, np.nan)
    axis.plot(solution.drive.time, error, color=STYLE.reproduced, linewidth=0.8, label="this drive")
    # Not scaled to the worst frame: faint frames can have errors of several hundred per cent.
    top = np.nanpercentile(error, 99) if solution.plays.any() else 0
    axis.set_ylim(0, max(20.0, 1.2 * top))
    axis.margins(x=0)
    axis.legend(fontsize=8, frameon=False, loc="upper right")
    return figure


def trials_figure(trials: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw a line per trial: mean, middle 90 % and worst frame in %, with its strength at the right."""
    figure = new_figure(8.0, 1.2 + 0.26 * len(trials), simulated=True)
    axes = plain_axes(figure.subplots(), x="E (%): mean, middle 90 % of the frames, worst frame")
    top = 100 * max(one["worst"] for one in trials) or 1.0
    for row, one in enumerate(trials):
        axes.plot([100 * one["p5"], 100 * one["p95"]], [row, row], color=STYLE.reproduced, linewidth=5, alpha=0.3)
        axes.plot(100 * one["mean"], row, "o", color=STYLE.reproduced, markersize=5)
        axes.plot(100 * one["worst"], row, "|", color=STYLE.ink, markersize=9)
        axes.annotate(
            f"{one['strength']:.3f}", (1.01, row), xycoords=("axes fraction", "data"), fontsize=8, va="center"
        )
    axes.annotate("strength", (1.01, 1.02), xycoords="axes fraction", fontsize=8, va="bottom")
    axes.set_yticks(range(len(trials)), [f"{one['recording']} {one['variant']}".strip() for one in trials])
    axes.set_ylim(len(trials) - 0.5, -0.5)
    axes.set_xlim(0, 1.04 * top)
    return figure


def passes_figure(series: Sequence[tuple[str, Sequence[float]]], *, simulated: bool) -> Figure:
    """Draw the error of the waveform, ||reproduced - original|| / ||original||, after each pass of each named loop."""
    figure = new_figure(5.4, 3.0, simulated=simulated)
    axis = plain_axes(figure.subplots(), x="pass", y="error of the waveform (%)")
    for (name, errors), colour in zip(series, cycle(STYLE.lines), strict=False):
        axis.plot(
            range(1, len(errors) + 1), [100 * error for error in errors], "o-", color=colour, markersize=4, label=name
        )
    axis.set_ylim(0)
    axis.set_xticks(range(1, 1 + max(len(errors) for _, errors in series)))
    axis.legend(fontsize=8, frameon=False)
    return figure


def budget_figure(budgets: Sequence[tuple[str, Budget]]) -> Figure:
    """Draw signal-to-distortion ratio and images after each stage, one row of panels per named budget."""
    simulated = any(each.simulated for _, each in budgets)
    figure = new_figure(8.6, 2.7 * len(budgets) + 0.5, simulated=simulated)
    axes = figure.subplots(len(budgets), 2, squeeze=False, sharex="col")
    low, high = budgets[0][1].band
    felt, images = f"{TOUCHED}, {low:g} to {high:g} Hz (dB)", "images, 530 to 1000 Hz, re the band (dB)"
    for row, (name, each) in zip(axes, budgets, strict=True):
        names = [stage.name for stage in each.stages]
        place = np.arange(len(names))[::-1]
        _waterfall(plain_axes(row[0], title=f"{name}, strength {each.strength:.2f}", x=felt), each, place)
        row[0].set_yticks(place, names, fontsize=8)
        _images(plain_axes(row[1], x=images), each, place)
        row[1].set_yticks(place, [""] * len(names))
        for axis in row:
            axis.set_ylim(-0.6, len(names) - 0.4)
            axis.label_outer()
    legend_above(figure, axes[0, 0])
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
