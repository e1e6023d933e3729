"""Pressure on a palm for several ways of playing: maps, and the time course at one cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from midair.evaluate import PressedPalm
from midair.figures.style import Style, new_figure, plain_axes
from midair.model import PressureFrames

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from matplotlib.image import AxesImage

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PalmPanel:
    """One way of playing."""

    name: str
    """Title of its map."""
    felt: PressureFrames
    """Pressure at the sensor."""
    pressed: PressedPalm
    """Pressure on the palm."""


def palm_figure(
    original: PressureFrames, ways: Sequence[PalmPanel], *, window: float = 0.1, style: Style | None = None
) -> Figure:
    """Draw maps of the palm, target first and then each way; below them the strongest cell of each.

    The traces are `window` seconds long, around the strongest moment of the recorded pressure `original`.
    """
    style = style or Style()
    simulated = original.provenance.simulated or any(way.felt.provenance.simulated for way in ways)
    figure = new_figure(3.0 * (len(ways) + 1) + 0.9, 5.6, simulated=simulated, style=style)
    parts = figure.add_gridspec(2, 1, height_ratios=[1.25, 1])
    _draw_maps(figure.add_subfigure(parts[0]), ways, style)
    _draw_traces(figure.add_subfigure(parts[1]), original, ways, window, style)
    return figure


def _draw_maps(figure: SubFigure, ways: Sequence[PalmPanel], style: Style) -> None:
    maps = [("target", ways[0].pressed.wanted), *((way.name, way.pressed.delivered) for way in ways)]
    top = max(float(np.nanmax(values)) for _, values in maps) or 1.0
    axes = figure.subplots(1, len(maps), sharex=True, sharey=True, squeeze=False)[0]
    image: AxesImage | None = None
    for axis, (name, values) in zip(axes, maps, strict=True):
        image = _draw_palm(axis, values, ways[0].pressed, top, style)
        axis.set_title(name, fontsize=9, loc="left", color=style.ink)
    axes[0].set_ylabel("y (mm)", fontsize=9)
    if image is not None:
        bar = figure.colorbar(image, ax=list(axes), shrink=0.85, pad=0.02)
        bar.set_label("pressure (Pa, rms in the band)", fontsize=8)
        bar.ax.tick_params(labelsize=8)


def _draw_palm(axis: Axes, values: Array, palm: PressedPalm, top: float, style: Style) -> AxesImage:
    from matplotlib.colors import PowerNorm
    from matplotlib.patches import Rectangle

    rows, columns = values.shape
    x, y = (0.5e3 * palm.pitch * count for count in (columns, rows))
    # Leakage may be many times stronger than the target: on a square-root scale both are visible.
    roots = PowerNorm(0.5, vmin=0, vmax=top)
    image = axis.imshow(values, cmap=style.quantity, norm=roots, extent=(-x, x, y, -y), origin="upper")
    half_x, half_y = (1e3 * half for half in palm.square)
    axis.add_patch(Rectangle((-half_x, -half_y), 2 * half_x, 2 * half_y, fill=False, edgecolor="white", linestyle="--"))
    axis.tick_params(labelsize=8)
    axis.set_xlabel("x (mm)", fontsize=9)
    return image


def _draw_traces(
    figure: SubFigure, original: PressureFrames, ways: Sequence[PalmPanel], window: float, style: Style
) -> None:
    cell, begin = strongest_moment(original, window)
    axes = figure.subplots(1, len(ways), sharex=True, sharey=True, squeeze=False)[0]
    for axis, way in zip(axes, ways, strict=True):
        plain_axes(axis, style)
        for name, frames, colour in (
            ("original", original, style.original),
            ("re-recorded", way.felt, style.reproduced),
        ):
            # The rates may differ.
            part = (frames.time >= begin) & (frames.time <= begin + window)
            axis.plot(frames.time[part], frames.pressure[part, *cell], color=colour, linewidth=1, label=name)
        axis.set_title(f"{way.name}, cell {cell[0] + 1}, {cell[1] + 1}", fontsize=9, loc="left", color=style.ink)
        axis.margins(x=0)
        axis.set_xlabel("time (s)", fontsize=9)
    axes[0].set_ylabel("pressure (Pa)", fontsize=9)
    axes[0].legend(fontsize=8, frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 0.98), borderaxespad=0)


def strongest_moment(frames: PressureFrames, window: float) -> tuple[tuple[int, int], float]:
    """Return row and column of the strongest cell, and the start in s of the window with its largest power."""
    power = (frames.pressure**2).reshape(frames.frames, -1)
    cell = int(power.sum(axis=0).argmax())
    length = min(round(window * frames.rate), frames.frames)
    over = np.convolve(power[:, cell], np.ones(length), mode="valid")
    row, column = divmod(cell, frames.sensor.columns)
    return (row, column), float(frames.time[int(over.argmax())])
