"""Traces; maps of pressure on cells and palm, sound at control points, phases of the array; perceptual metrics."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from midair.array_types import Array
from midair.dsp import strongest_window, welch
from midair.evaluate import PerceptualFigure, PerceptualMetrics
from midair.figures.style import STYLE, colour_bar, data_url, label_axes, legend_above, new_figure, plain_axes
from midair.model import ControlGrid, Drive, PressureFrames, SensorGrid
from midair.physics import Exposure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def traces_figure(original: PressureFrames, reproduced: PressureFrames | None = None) -> Figure:
    """Draw the pressure of every channel on one scale, laid out like the cells; the original is the wide line."""
    rows, columns = original.sensor.shape
    simulated = original.provenance.simulated or (reproduced is not None and reproduced.provenance.simulated)
    figure = new_figure(2.5 * columns, 1.35 * rows + 0.6, simulated=simulated)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for channel, axis in enumerate(axes.ravel()):
        row, column = divmod(channel, columns)
        plain_axes(axis, title=f"channel {channel}")
        # The wide line of the original is seen on both sides of the reproduction.
        wide = {"color": STYLE.original, "linewidth": 0.7 if reproduced is None else 2.0}
        axis.plot(original.time, original.pressure[:, row, column], label="original", **wide)
        if reproduced is not None:
            shown = reproduced.pressure[: original.frames, row, column]
            axis.plot(reproduced.time[: len(shown)], shown, color=STYLE.reproduced, linewidth=0.6, label="re-recorded")
        axis.margins(x=0)
    figure.supxlabel("time (s)", fontsize=9)
    figure.supylabel("pressure (Pa)", fontsize=9)
    if reproduced is not None:
        legend_above(figure, axes[0, 0])
    return figure


def spectra_figure(
    rows: Mapping[str, Mapping[str, PressureFrames]],
    *,
    channels: Sequence[int] = (2, 6, 10, 14),
    rectified: bool = True,
    objects: bool = False,
) -> Figure:
    """Draw power spectra of the calibrated pressure of named recordings at some channels, in named rows.

    The default channels are the four of the paper, over which the objects passed. With `rectified` only the positive
    pressure is used, as in the paper's Fig. 9, which compares `objects` from 0 to 500 Hz; otherwise the first recording
    of a row is the original, and the axis ends with the last frequency that is in the picture.
    """
    colours = (STYLE.before, "#009e73", STYLE.reproduced) if objects else STYLE.pair
    simulated = any(one.provenance.simulated for each in rows.values() for one in each.values())
    figure = new_figure(2.65 * len(channels), 2.0 * len(rows) + 0.9, simulated=simulated)
    axes = figure.subplots(len(rows), len(channels), sharex=True, sharey=True, squeeze=False)
    levels = list[tuple[Array, Array]]()
    for line, (row, series) in zip(axes, rows.items(), strict=True):
        for axis, channel in zip(line, channels, strict=True):
            title, label = f"channel {channel}" if line[0] is axes[0, 0] else "", "power density (dB re 1 Pa²/Hz)"
            plain_axes(axis, title=title, y=f"{row}\n(dB re 1 Pa²/Hz)" if row else label).label_outer()
            for number, ((name, frames), colour) in enumerate(zip(series.items(), colours, strict=False)):
                pressure = frames.pressure.reshape(frames.frames, -1)[:, channel]
                frequency, density = welch(np.maximum(pressure, 0) if rectified else pressure, frames.rate)
                # 0 Hz is left out: it is no vibration.
                levels.append((frequency[1:], 10 * np.log10(np.maximum(density[1:], 1e-12))))
                axis.plot(*levels[-1], color=colour, linewidth=0.9 if objects or number else 2.0, label=name)
            if objects:
                # Grooves dominate below 300 Hz, objects differ above (paper, 5.3).
                axis.axvline(300, color=STYLE.faint, linewidth=0.8)
            axis.margins(x=0)
    top = max(float(level.max()) for _, level in levels)
    axes[0, 0].set_ylim(top - 60, top + 5)
    last = max(frequency[level > top - 60].max(initial=1) for frequency, level in levels)
    axes[0, 0].set_xlim(0, 500 if objects else last)
    figure.supxlabel("frequency (Hz)", fontsize=9)
    legend_above(figure, axes[0, 0])
    return figure


def beam_figure(commanded: Array, measured: Array, *, gain: float, intercept: float, simulated: bool) -> Figure:
    """Draw the amplitude that the sensor measured in a focus over the commanded amplitude, with the fitted line."""
    figure = new_figure(3.6, 3.0, simulated=simulated)
    axis = plain_axes(figure.subplots(), x="commanded amplitude (Pa)", y="measured amplitude (Pa)")
    ends = np.array([0.0, float(commanded.max())])
    axis.plot(ends, intercept + gain * ends, color=STYLE.reproduced, linewidth=1, label=f"gain {gain:.3f}")
    axis.plot(commanded, measured, "o", color=STYLE.original, markersize=4, label="measured")
    axis.set_xlim(0)
    axis.set_ylim(0)
    axis.legend(fontsize=8, frameon=False)
    return figure


def exposure_figure(exposure: Exposure, *, simulated: bool) -> Figure:
    """Draw the level of every frame at every place, each with its limit as a dashed line of the same colour."""
    figure = new_figure(8.0, 3.2, simulated=simulated)
    axis = plain_axes(figure.subplots(), title=exposure.verdict(), x="time (s)", y="level (dB re 20 µPa rms)")
    time = np.arange(len(exposure.level)) / exposure.rate
    for number, (place, colour) in enumerate(zip(exposure.profile.places, cycle(STYLE.lines), strict=False)):
        # Silent frames are left out: their level at the floor of the scale would stretch the axis.
        heard = exposure.level[:, number] > 0
        label = f"{place.name}, limit {place.limit:g} dB{'' if place.enforced else ' (advice)'}"
        axis.plot(time, np.where(heard, exposure.level[:, number], np.nan), color=colour, linewidth=0.8, label=label)
        axis.axhline(place.limit, color=colour, linewidth=0.8, linestyle="--")
    axis.margins(x=0)
    axis.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure


def maps_figure(
    maps: Sequence[tuple[str, Array]],
    grid: ControlGrid | SensorGrid,
    *,
    quantity: str,
    simulated: bool,
    sensor: SensorGrid | None = None,
) -> Figure:
    """Draw maps of one quantity, each with a title, side by side on one colour scale with the label `quantity`.

    Values have the shape (row, column) or (point,). White circles mark the cells of `sensor`, as in the paper's Fig. 3.
    """
    figure = new_figure(3.1 * len(maps) + 0.9, 3.3, simulated=simulated)
    axes = figure.subplots(1, len(maps), sharex=True, sharey=True, squeeze=False)[0]
    top = max(float(np.max(values)) for _, values in maps) or 1.0
    for axis, (title, values) in zip(axes, maps, strict=True):
        draw_map(axis, values, grid, top, title=title, sensor=sensor)
    colour_bar(figure, list(axes), quantity)
    return figure


def phase_figure(drive: Drive, frame: int, *, simulated: bool) -> Figure:
    """Draw the array from above, each transducer coloured by its phase in one frame."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    figure = new_figure(5.6, 4.0, simulated=simulated)
    axis = figure.subplots()
    places = 1e3 * drive.array.position[:, :2]
    circles = PatchCollection([Circle((x, y), 4.6) for x, y in places], cmap=STYLE.phase, linewidth=0)
    circles.set_array(np.mod(drive.phase[frame], 2 * np.pi))
    circles.set_clim(0, 2 * np.pi)
    axis.add_collection(circles)
    axis.set_xlim(places[:, 0].min() - 8, places[:, 0].max() + 8)
    # y grows downwards, as the rows of the maps do.
    axis.set_ylim(places[:, 1].max() + 8, places[:, 1].min() - 8)
    axis.set_aspect("equal")
    label_axes(axis, x="x (mm)", y="y (mm)")
    bar = figure.colorbar(circles, ax=axis, shrink=0.85, pad=0.02, ticks=[0, np.pi, 2 * np.pi])
    bar.ax.set_yticklabels(["0", "π", "2π"], fontsize=8)
    bar.set_label("phase (rad)", fontsize=9)
    return figure


def draw_map(
    axis: Axes,
    values: Array,
    grid: ControlGrid | SensorGrid,
    top: float,
    *,
    title: str,
    row: str = "",
    sensor: SensorGrid | None = None,
    size: float = 8,
) -> None:
    """Draw values of the points of a grid from 0 to `top`, with circles on the cells of a sensor.

    Axes at the left of a figure have the name of their `row`; `size` is that of `label_axes`.
    """
    half = 0.5e3 * grid.pitch
    x, y = 1e3 * grid.x, 1e3 * grid.y
    extent = (x[0] - half, x[-1] + half, y[-1] + half, y[0] - half)
    shown = np.reshape(values, grid.shape)
    axis.imshow(shown, cmap=STYLE.quantity, vmin=0, vmax=top, extent=extent, origin="upper")
    label_axes(axis, title=title, x="x (mm)", y=f"{row}\ny (mm)" if row else "y (mm)", size=size).label_outer()
    if sensor is not None:
        x, y = (1e3 * each.ravel() for each in np.meshgrid(sensor.x, sensor.y))
        axis.plot(x, y, "o", mfc="none", mec="white", markersize=size - 3, mew=0.2 * (size - 4))


SHOWN = ("ST-SIM", "SPQI", "Pacinian power difference")
"""Metrics that are shown as maps; the others follow from them."""


def card_figure(card: PerceptualMetrics) -> Figure:
    """Draw each metric cell by cell, laid out like the sensor; a dash where it is undefined."""
    figure = new_figure(2.15 * len(SHOWN), 3.2, simulated=card.simulated)
    axes = figure.subplots(1, len(SHOWN), squeeze=False)[0]
    for axis, name in zip(axes, SHOWN, strict=True):
        _metric_map(axis, card.figure(name))
    return figure


def _metric_map(axis: Axes, figure: PerceptualFigure) -> None:
    values = np.where(np.isfinite(figure.channels), figure.channels, np.nan)
    low, high, colours = (0.0, 1.0, STYLE.quantity)
    if "difference" in figure.name:
        low, high, colours = -12.0, 12.0, "RdBu_r"
    elif figure.unit == "dB":
        low, high = -10.0, 40.0
    axis.imshow(values, cmap=colours, vmin=low, vmax=high)
    for (row, column), value in np.ndenumerate(values):
        dark = low + 0.6 * (high - low) > value if colours == STYLE.quantity else abs(value) > 8
        ink = "white" if dark and np.isfinite(value) else STYLE.ink
        text = "–" if np.isnan(value) else f"{value:.2f}" if not figure.unit else f"{value:.0f}"
        axis.text(column, row, text, ha="center", va="center", fontsize=7, color=ink)
    unit = f" ({figure.unit})" if figure.unit else ""
    head = figure.name.replace(", ", ",\n").replace("power difference", "power\ndifference")
    overall = f"overall {figure.overall:.2f}{' ' + figure.unit if figure.unit else ''}"
    label_axes(axis, title=f"{head}{unit}", x=overall)
    axis.set_xticks([])
    axis.set_yticks([])


def map_source(values: Array, top: float) -> str:
    """Draw a map of values from 0, which is transparent, to `top`, as the data URL of a PNG with one pixel a value.

    `values` have the shape (row, column); the last row is on top, since y grows upwards. NaN is transparent.
    """
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.image import imsave

    share = np.clip(np.nan_to_num(values[::-1]) / top, 0, 1)
    colours = LinearSegmentedColormap.from_list("touch", STYLE.touch)(share)
    colours[..., 3] = np.minimum(1, 7 * share)
    imsave(out := io.BytesIO(), colours, format="png")
    return data_url(out.getvalue())


def strongest_moment(frames: PressureFrames, window: float) -> tuple[tuple[int, int], float]:
    """Return row and column of the strongest cell, and the start in s of the window with its largest power."""
    power = (frames.pressure**2).reshape(frames.frames, -1)
    cell = int(power.sum(axis=0).argmax())
    begin = strongest_window(power[:, cell], round(window * frames.rate))
    return divmod(cell, frames.sensor.columns), begin / frames.rate
