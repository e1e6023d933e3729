"""Maps of pressure on the cells, sound at the control points, phases of the array, and perceptual metrics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from midair.evaluate import PerceptualFigure, PerceptualMetrics
from midair.figures.style import Style, new_figure
from midair.model import ControlGrid, Drive, SensorGrid

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

Array = NDArray[np.float64]


def maps_figure(
    maps: Sequence[tuple[str, Array]],
    grid: ControlGrid | SensorGrid,
    *,
    quantity: str,
    simulated: bool,
    sensor: SensorGrid | None = None,
    style: Style | None = None,
) -> Figure:
    """Draw maps of one quantity, each with a title, side by side on one colour scale with the label `quantity`.

    Values have the shape (row, column) or (point,). White circles mark the cells of `sensor`, as in the paper's Fig. 3.
    """
    style = style or Style()
    figure = new_figure(3.1 * len(maps) + 0.9, 3.3, simulated=simulated, style=style)
    axes = figure.subplots(1, len(maps), sharex=True, sharey=True, squeeze=False)[0]
    top = max(float(np.max(values)) for _, values in maps) or 1.0
    image: AxesImage | None = None
    for axis, (title, values) in zip(axes, maps, strict=True):
        image = _map(axis, np.reshape(values, grid.shape), grid, top, style)
        axis.set_title(title, fontsize=9, color=style.ink, loc="left")
        if sensor is not None:
            x, y = np.meshgrid(1e3 * sensor.x, 1e3 * sensor.y)
            axis.plot(x.ravel(), y.ravel(), "o", markerfacecolor="none", markeredgecolor="white", markersize=5, mew=0.8)
    axes[0].set_ylabel("y (mm)", fontsize=9)
    if image is not None:
        bar = figure.colorbar(image, ax=list(axes), shrink=0.85, pad=0.02)
        bar.set_label(quantity, fontsize=9)
        bar.ax.tick_params(labelsize=8)
    return figure


def phase_figure(drive: Drive, frame: int, *, simulated: bool, style: Style | None = None) -> Figure:
    """Draw the array from above, each transducer coloured by its phase in one frame."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    style = style or Style()
    figure = new_figure(5.6, 4.0, simulated=simulated, style=style)
    axis = figure.subplots()
    places = 1e3 * drive.array.position[:, :2]
    circles = PatchCollection([Circle((x, y), 4.6) for x, y in places], cmap=style.phase, linewidth=0)
    circles.set_array(np.mod(drive.phase[frame], 2 * np.pi))
    circles.set_clim(0, 2 * np.pi)
    axis.add_collection(circles)
    axis.set_xlim(places[:, 0].min() - 8, places[:, 0].max() + 8)
    # y grows downwards, as the rows of the maps do.
    axis.set_ylim(places[:, 1].max() + 8, places[:, 1].min() - 8)
    axis.set_aspect("equal")
    axis.tick_params(labelsize=8)
    axis.set_xlabel("x (mm)", fontsize=9)
    axis.set_ylabel("y (mm)", fontsize=9)
    bar = figure.colorbar(circles, ax=axis, shrink=0.85, pad=0.02, ticks=[0, np.pi, 2 * np.pi])
    bar.ax.set_yticklabels(["0", "π", "2π"], fontsize=8)
    bar.set_label("phase (rad)", fontsize=9)
    return figure


def _map(axis: Axes, values: Array, grid: ControlGrid | SensorGrid, top: float, style: Style) -> AxesImage:
    half = 0.5e3 * grid.pitch
    x, y = 1e3 * grid.x, 1e3 * grid.y
    extent = (x[0] - half, x[-1] + half, y[-1] + half, y[0] - half)
    image = axis.imshow(values, cmap=style.quantity, vmin=0, vmax=top, extent=extent, origin="upper")
    axis.tick_params(labelsize=8)
    axis.set_xlabel("x (mm)", fontsize=9)
    return image


SHOWN = ("ST-SIM", "SPQI", "Pacinian power, original", "Pacinian power, reproduced", "Pacinian power difference")
"""Metrics that are shown as maps; the others follow from them."""


def card_figure(card: PerceptualMetrics, *, style: Style | None = None) -> Figure:
    """Draw each metric cell by cell, laid out like the sensor; a dash where it is undefined."""
    style = style or Style()
    figure = new_figure(2.15 * len(SHOWN), 3.2, simulated=card.simulated, style=style)
    axes = figure.subplots(1, len(SHOWN), squeeze=False)[0]
    for axis, name in zip(axes, SHOWN, strict=True):
        _metric_map(axis, card.figure(name), style)
    return figure


def _metric_map(axis: Axes, figure: PerceptualFigure, style: Style) -> None:
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
    head = figure.name.replace("Pacinian power, ", "Pacinian power,\n").replace("power difference", "power\ndifference")
    axis.set_title(f"{head}{unit}", fontsize=8, loc="left", color=style.ink)
    axis.set_xlabel(f"overall {figure.overall:.2f}{' ' + figure.unit if figure.unit else ''}", fontsize=8)
    axis.set_xticks([])
    axis.set_yticks([])
