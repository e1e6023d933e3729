"""Figures of a study: confusion matrices, F-measures and ratings (paper, Figs. 6 to 8), chance and power."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from midair.errors import InputError
from midair.figures import STYLE, new_figure, plain_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from midair.study.findings import Choices
    from midair.study.statistics import Chance


def confusion_figure(choices: Sequence[Choices], *, simulated: bool) -> Figure:
    """Confusion matrix of each condition (Fig. 6); `simulated` marks the figure."""
    figure = new_figure(2.7 * len(choices) + 0.4, 2.9, simulated=simulated)
    for place, one in enumerate(choices):
        axes = figure.add_subplot(1, len(choices), place + 1)
        counts = one.confusion.counts
        axes.imshow(counts / counts.sum(axis=1, keepdims=True), cmap="Blues", vmin=0, vmax=1)
        for (row, column), count in np.ndenumerate(counts):
            dark = count > counts[row].sum() / 2
            axes.text(column, row, str(count), ha="center", va="center", color="white" if dark else STYLE.ink)
        labels = [str(label) for label in one.confusion.labels]
        _name_ticks(axes, labels)
        axes.set_yticks(range(len(labels)), labels, fontsize=8)
        axes.set_title(one.name, fontsize=9)
        axes.set_xlabel("answered (number of trials)", fontsize=8)
        axes.set_ylabel("presented", fontsize=8)
    return figure


def f_figure(choices: Sequence[Choices], *, simulated: bool) -> Figure:
    """F-measure of each object with confidence intervals (Fig. 7), for choices of the same objects."""
    figure = new_figure(4.2, 3, simulated=simulated)
    axes = plain_axes(figure.add_subplot())
    width = 0.8 / len(choices)
    colours = [STYLE.before, STYLE.reproduced, "#999999"]
    for place, one in enumerate(choices):
        value = one.confusion.f_measure
        x = np.arange(len(value)) + (place - (len(choices) - 1) / 2) * width
        axes.bar(x, value, width * 0.92, label=one.name, color=colours[place % 3])
        if one.f_limits is not None:
            limits = np.clip([value - one.f_limits.low, one.f_limits.high - value], 0, None)
            # A wide white bar below a black one is visible on every colour.
            axes.errorbar(x, value, limits, fmt="none", ecolor="white", capsize=4, linewidth=3.0, capthick=3.0)
            axes.errorbar(x, value, limits, fmt="none", ecolor="black", capsize=3.5, linewidth=1.2, capthick=1.2)
    labels = [str(label) for label in choices[0].confusion.labels]
    axes.axhline(1 / len(labels), color=STYLE.ink, linewidth=0.8, linestyle=":")
    _name_ticks(axes, labels)
    axes.set_ylim(0, 1.02)
    axes.set_ylabel("F-measure, 95 % over people", fontsize=8)
    axes.legend(fontsize=8, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def rating_figure(
    ratings: DataFrame,
    within: Sequence[str],
    *,
    simulated: bool,
    title: str = "",
    span: tuple[float, float] | None = None,
) -> Figure:
    """Mean ratings with confidence intervals; with three factors one panel for each level of the first (Fig. 8).

    `ratings` has the columns of the factors, mean, low, high. The last factor of `within` is the colour, the one before
    it the axis; a single factor is the axis. `title` is that of a single panel, `span` the range of the rating axis.
    Raises InputError for more than three factors.
    """
    if not 1 <= len(within) <= 3:
        raise InputError(f"figure of ratings: expected one to three factors, got {len(within)}")
    panels = sorted(set(ratings[within[0]].tolist())) if len(within) == 3 else [""]
    figure = new_figure(3.4 * len(panels) + 0.5, 3, simulated=simulated)
    shared = None
    for place, panel in enumerate(panels):
        axes = plain_axes(figure.add_subplot(1, len(panels), place + 1, sharey=shared))
        shared = shared or axes
        rows = ratings.loc[ratings[within[0]] == panel] if panel else ratings
        _rating_panel(axes, rows, within[-2:][0], within[-1] if len(within) > 1 else "")
        axes.set_title(f"{within[0]}: {panel}" if panel else title, fontsize=9)
        if place == 0:
            axes.set_ylabel("rating, 95 % within people", fontsize=8)
        if span is not None:
            axes.set_ylim(span)
    handles, names = figure.axes[0].get_legend_handles_labels()
    if names:
        columns = max(1, min(len(names), 3, int(18 * figure.get_figwidth()) // (max(map(len, names)) + 6)))
        figure.legend(handles, names, fontsize=8, frameon=False, ncols=columns, loc="outside lower center")
    return figure


def chance_figure(chance: Chance, *, simulated: bool, quantity: str = "macro F") -> Figure:
    """Distribution of a statistic under the null hypothesis, its middle 95 %, and the observed value."""
    figure = new_figure(5, 2.8, simulated=simulated)
    axes = plain_axes(figure.add_subplot())
    axes.hist(chance.distribution, bins=40, color=STYLE.before, density=True)
    low, high = chance.range95
    axes.axvspan(low, high, color=STYLE.band, zorder=0)
    axes.axvline(chance.value, color=STYLE.reproduced, linewidth=1.5)
    axes.set_xlabel(f"{quantity} by chance; shaded: middle 95 %, {low:.3f} to {high:.3f}", fontsize=8)
    axes.set_ylabel("density", fontsize=8)
    return figure


def power_figure(curves: Sequence[tuple[str, DataFrame]], *, simulated: bool = False) -> Figure:
    """Power against the number of participants; `curves` have columns participants, power, and low, high if known."""
    figure = new_figure(5, 3, simulated=simulated)
    axes = plain_axes(figure.add_subplot())
    for (name, table), line in zip(curves, ("-", "--", ":", "-.") * len(curves), strict=False):
        axes.plot(table["participants"], table["power"], line, label=name, color=STYLE.reproduced)
        if "low" in table:
            axes.fill_between(table["participants"], table["low"], table["high"], color=STYLE.band)
    axes.axhline(0.8, color=STYLE.ink, linewidth=0.8, linestyle=":")
    axes.set_ylim(0, 1.02)
    axes.set_xlabel("pairs or participants", fontsize=8)
    axes.set_ylabel("power", fontsize=8)
    axes.legend(fontsize=8, frameon=False)
    return figure


def _name_ticks(axes: Axes, names: Sequence[str]) -> None:
    """Names along the horizontal axis; slanted if they would run into each other."""
    axes.set_xticks(range(len(names)), names, fontsize=8)
    if len(names) * max(map(len, names)) > 24:
        for label in axes.get_xticklabels():
            label.set(rotation=25, ha="right", rotation_mode="anchor")


def _rating_panel(axes: Axes, rows: DataFrame, across: str, colour: str) -> None:
    places = sorted(set(rows[across].tolist()))
    shades = [STYLE.before, STYLE.reproduced, STYLE.original]
    series = sorted(set(rows[colour].tolist())) if colour else [""]
    for i, level in enumerate(series):
        part = rows.loc[rows[colour] == level] if colour else rows
        place = [places.index(name) for name in part[across].tolist()]
        x = np.array(place) + (i - (len(series) - 1) / 2) * 0.2
        error = np.array([part["mean"] - part["low"], part["high"] - part["mean"]])
        axes.errorbar(
            x,
            part["mean"],
            error,
            fmt="o",
            ms=4,
            capsize=2,
            color=shades[i % 3],
            label=f"{colour}: {level}" if colour else None,
        )
    _name_ticks(axes, [str(place) for place in places])
    axes.set_xlabel(across, fontsize=8)
