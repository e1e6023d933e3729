"""The paper's figures 3, 4 and 9, and those of sweeps over patterns: distribution of E, examples, E over height."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from midair.array_types import Array
from midair.dsp import welch
from midair.figures.maps import draw_map
from midair.figures.style import STYLE, new_figure, plain_axes
from midair.model import ControlGrid, PressureFrames, SensorGrid

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Example:
    """A solved pattern."""

    name: str
    error: float
    """E."""
    target: Array
    """Target magnitude relative to a focus of the whole array, shape (point,)."""
    field: Array
    """Solved magnitude relative to the same focus, shape (point,)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """E over a quantity: mean, and the range of the middle 90 % of the patterns, each of shape (value,)."""

    name: str
    x: Array
    mean: Array
    low: Array
    high: Array


def histogram_figure(errors: Sequence[tuple[str, Array]], *, published: tuple[float, float]) -> Figure:
    """Draw the distribution of E over the patterns of each named condition.

    The range `published` of the average E that the paper reports is shaded.
    """
    figure = new_figure(7.0, 3.0, simulated=True)
    axes = plain_axes(figure.subplots(), x="E (%)", y="patterns")
    axes.axvspan(100 * published[0], 100 * published[1], color=STYLE.band, zorder=0, label="paper, average")
    top = 100 * max(float(values.max()) for _, values in errors)
    bins = np.linspace(0, top, 121).tolist()
    for (name, values), colour in zip(errors, _colours(len(errors)), strict=True):
        label = f"{name}: mean {100 * values.mean():.1f} %, worst {100 * values.max():.1f} %, {len(values)} patterns"
        axes.hist(100 * values, bins=bins, histtype="stepfilled", color=colour, alpha=0.35)
        axes.hist(100 * values, bins=bins, histtype="step", color=colour, linewidth=1.1, label=label)
    axes.set_xlim(0, max(top, 100 * published[1]) * 1.02)
    # Space for the legend.
    axes.set_ylim(0, axes.get_ylim()[1] * 1.3)
    axes.legend(fontsize=8, frameon=False, loc="upper right")
    return figure


def examples_figure(examples: Sequence[Example], grid: ControlGrid, sensor: SensorGrid, *, title: str) -> Figure:
    """Draw targets above, fields below, on one scale; circles are the channels, as in the paper's Fig. 3."""
    figure = new_figure(1.75 * len(examples) + 1.2, 4.2, simulated=True)
    axes = figure.subplots(2, len(examples), sharex=True, sharey=True, squeeze=False)
    top = max(max(float(one.target.max()), float(one.field.max())) for one in examples)
    image = None
    for column, one in zip(axes.T, examples, strict=True):
        for axis, values in zip(column, (one.target, one.field), strict=True):
            image = draw_map(axis, values, grid, top, sensor=sensor, size=7)
        column[0].set_title(one.name, fontsize=8, loc="left", color=STYLE.ink)
        column[1].set_title(f"E {100 * one.error:.1f} %", fontsize=8, loc="left", color=STYLE.ink)
        column[1].set_xlabel("x (mm)", fontsize=8)
    for axis, name in zip(axes[:, 0], ("target", "field"), strict=True):
        axis.set_ylabel(f"{name}\ny (mm)", fontsize=8)
    bar = figure.colorbar(image, ax=axes.ravel().tolist(), shrink=0.8, pad=0.02)  # pyright: ignore[reportArgumentType]
    bar.set_label("sound pressure re a full focus", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    figure.suptitle(title, x=0.01, ha="left", fontsize=9)
    return figure


def curve_figure(curves: Sequence[Curve], *, quantity: str, published: tuple[float, float]) -> Figure:
    """Draw mean E over a quantity; shaded: the middle 90 % of the patterns."""
    figure = new_figure(5.2, 3.2, simulated=True)
    axes = plain_axes(figure.subplots(), x=quantity, y="E (%)")
    axes.axhspan(100 * published[0], 100 * published[1], color=STYLE.band, zorder=0, label="paper, average")
    for curve, colour in zip(curves, _colours(len(curves)), strict=True):
        axes.fill_between(curve.x, 100 * curve.low, 100 * curve.high, color=colour, alpha=0.18, linewidth=0)
        axes.plot(curve.x, 100 * curve.mean, "o-", color=colour, markersize=3.5, linewidth=1.2, label=curve.name)
    axes.set_ylim(0, None)
    axes.legend(fontsize=8, frameon=False, loc="upper left")
    return figure


def _colours(count: int) -> list[str]:
    return [(STYLE.reproduced, STYLE.before, STYLE.original)[number % 3] for number in range(count)]


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
    image = None
    for line, row in zip(axes, rows, strict=True):
        for axis, values, note in zip(line, row.fields, row.notes, strict=True):
            image = draw_map(axis, values, row.grid, top, sensor=sensor, size=7)
            axis.set_title(note, fontsize=7, loc="left", color=STYLE.ink)
        line[0].set_ylabel(f"{row.name}\ny (mm)", fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("x (mm)", fontsize=8)
    bar = figure.colorbar(image, ax=axes.ravel().tolist(), shrink=0.8, pad=0.02)  # pyright: ignore[reportArgumentType]
    bar.set_label(quantity, fontsize=8)
    bar.ax.tick_params(labelsize=7)
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
            place, wave = axes[row, 2 * column], plain_axes(axes[row, 2 * column + 1])
            place.imshow(np.sqrt((each[name].pressure ** 2).mean(axis=0)), cmap=STYLE.quantity, vmin=0, vmax=top)
            place.set_xticks([])
            place.set_yticks([])
            place.set_ylabel(name if column == 0 else "", fontsize=8)
            place.set_title(f"{stimulus}, rms 0 to {top:.0f} Pa" if row == 0 else "", fontsize=8, loc="left")
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
            wave.set_ylabel("pressure (Pa)", fontsize=8)
            wave.set_xlabel("time (ms)" if row == len(rows) - 1 else "", fontsize=8)
    return figure


def objects_figure(
    rows: Mapping[str, Mapping[str, PressureFrames]], *, channels: Sequence[int] = (2, 6, 10, 14)
) -> Figure:
    """Draw power spectra of objects at some channels, one row per surface and mode, as in the paper's Fig. 9.

    `rows` holds the positive pressure of the objects of each row by name. The default channels are the four of the
    paper, over which the objects passed.
    """
    colours = (STYLE.before, "#009e73", STYLE.reproduced)
    simulated = any(one.provenance.simulated for each in rows.values() for one in each.values())
    figure = new_figure(2.6 * len(channels), 1.85 * len(rows) + 0.5, simulated=simulated)
    axes = figure.subplots(len(rows), len(channels), sharex=True, sharey=True, squeeze=False)
    top = -np.inf
    for number, (line, (row, objects)) in enumerate(zip(axes, rows.items(), strict=True)):
        for axis, channel in zip(line, channels, strict=True):
            plain_axes(axis)
            for (name, frames), colour in zip(objects.items(), colours, strict=False):
                frequency, density = welch(frames.pressure.reshape(frames.frames, -1)[:, channel], frames.rate)
                level = 10 * np.log10(np.maximum(density[1:], 1e-12))
                top = max(top, float(level.max()))
                axis.plot(frequency[1:], level, color=colour, linewidth=0.9, label=name)
            # Grooves dominate below 300 Hz, objects differ above (paper, 5.3).
            axis.axvline(300, color=STYLE.faint, linewidth=0.8)
            axis.set_xlim(0, 500)
            axis.set_title(f"channel {channel}" if number == 0 else "", fontsize=8, loc="left", color=STYLE.ink)
        line[0].set_ylabel(f"{row}\n(dB re 1 Pa²/Hz)", fontsize=7)
    axes[0, 0].set_ylim(top - 50, top + 3)
    figure.supxlabel("frequency (Hz)", fontsize=9)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3, fontsize=8, frameon=False)
    return figure
