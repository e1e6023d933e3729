"""Perceptual metrics as maps over the cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from midair.evaluate import PerceptualFigure, PerceptualMetrics
from midair.figures.style import Style, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = (
    "ST-SIM, level matched",
    "SPQI, level matched",
    "Pacinian power, original",
    "Pacinian power, reproduced",
    "Pacinian power difference",
)
"""Metrics that are shown as maps; the others follow from them."""


def card_figure(card: PerceptualMetrics, *, style: Style | None = None) -> Figure:
    """Draw each metric cell by cell, laid out like the sensor; a dash where it is undefined."""
    style = style or Style()
    figure = new_figure(2.15 * len(SHOWN), 3.2, simulated=card.simulated, style=style)
    axes = figure.subplots(1, len(SHOWN), squeeze=False)[0]
    for axis, name in zip(axes, SHOWN, strict=True):
        _map(axis, card.figure(name), style)
    return figure


def _map(axis: Axes, figure: PerceptualFigure, style: Style) -> None:
    values = np.where(np.isfinite(figure.channels), figure.channels, np.nan)
    low, high, colours = (0.0, 1.0, style.quantity)
    if "difference" in figure.name:
        low, high, colours = -12.0, 12.0, "RdBu_r"
    elif figure.unit == "dB":
        low, high = -10.0, 40.0
    axis.imshow(values, cmap=colours, vmin=low, vmax=high)
    for (row, column), value in np.ndenumerate(values):
        dark = low + 0.6 * (high - low) > value if colours == style.quantity else abs(value) > 8
        ink = "white" if dark and np.isfinite(value) else style.ink
        text = "–" if np.isnan(value) else f"{value:.2f}" if not figure.unit else f"{value:.0f}"
        axis.text(column, row, text, ha="center", va="center", fontsize=7, color=ink)
    unit = f" ({figure.unit})" if figure.unit else ""
    head = figure.name.replace(", ", ",\n").replace("power difference", "power\ndifference")
    axis.set_title(f"{head}{unit}", fontsize=8, loc="left", color=style.ink)
    axis.set_xlabel(f"overall {figure.overall:.2f}{' ' + figure.unit if figure.unit else ''}", fontsize=8)
    axis.set_xticks([])
    axis.set_yticks([])
