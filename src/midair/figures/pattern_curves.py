"""Figures of sweeps over patterns: distribution of E, examples as in the paper's Fig. 3, E over strength and height."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from midair.array_types import Array
from midair.figures.maps import draw_map
from midair.figures.style import STYLE, new_figure, plain_axes
from midair.model import ControlGrid, SensorGrid

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
