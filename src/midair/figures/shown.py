"""One small figure of anything that a stage returns."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.array_types import Array
from midair.evaluate import Comparison
from midair.figures.maps import phase_figure
from midair.figures.style import STYLE, data_url, label_axes, new_figure, plain_axes, png_bytes
from midair.model import AmplitudeFrames, Drive, PressureFrames, Recording, Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINTS = 1000
"""Most points of a curve; the least and greatest of the frames of each are drawn."""


def figure_of(thing: Recording | PressureFrames | AmplitudeFrames | Drive | Solution | Comparison) -> Figure:
    """Draw a recording, pressure, target, drive, solution or comparison.

    The strongest channel over time beside a map of the rms of all; of a drive the phases of its strongest frame; of a
    comparison maps of correlation and gain. Row 0 of a map is at the bottom, since y grows upwards.
    """
    if isinstance(thing, Solution):
        thing = thing.drive
    if isinstance(thing, Drive):
        level = np.asarray(thing.level).reshape(thing.frames, -1).sum(axis=1)
        return phase_figure(thing, int(level.argmax()), simulated=thing.provenance.simulated)
    if isinstance(thing, Comparison):
        figure = new_figure(6.4, 2.6, simulated=thing.simulated)
        maps = (("correlation", thing.channel_correlation), ("gain", thing.channel_gain))
        for axis, (title, values) in zip(figure.subplots(1, 2), maps, strict=True):
            _draw_cells(figure, axis, values, title)
        return figure
    values, shape, unit = _channels(thing)
    figure = new_figure(6.4, 2.6, simulated=thing.provenance.simulated)
    left, right = figure.subplots(1, 2, width_ratios=[1.7, 1])
    rms = np.sqrt((values**2).mean(axis=0))
    channel = int(rms.argmax())
    _draw_curve(plain_axes(left, title=f"channel {channel}", x="time (s)", y=unit), values[:, channel], thing.rate)
    _draw_cells(figure, right, rms.reshape(shape), f"rms, {unit}")
    return figure


def html_of(thing: Any) -> str:
    """HTML of a thing for a notebook: its text, and its figure."""
    return f'<pre>{escape(repr(thing))}</pre><img src="{data_url(png_bytes(figure_of(thing), dpi=90))}" alt="">'


def _channels(thing: Recording | PressureFrames | AmplitudeFrames) -> tuple[Array, tuple[int, int], str]:
    if isinstance(thing, AmplitudeFrames):
        return np.asarray(thing.amplitude), thing.grid.shape, "Pa of sound, peak"
    values, unit = (thing.samples, thing.unit) if isinstance(thing, Recording) else (thing.pressure, "Pa")
    return np.asarray(values).reshape(thing.frames, -1), thing.sensor.shape, unit


def _draw_curve(axis: Axes, values: Array, rate: float) -> None:
    block = -(-len(values) // _POINTS)
    first = np.arange(0, len(values), block)
    low, high = (edge.reduceat(values, first) for edge in (np.minimum, np.maximum))
    axis.plot(np.repeat(first / rate, 2), np.column_stack([low, high]).ravel(), color=STYLE.original, linewidth=0.7)
    axis.margins(x=0)


def _draw_cells(figure: Figure, axis: Axes, values: Array, title: str) -> None:
    image = axis.imshow(values, cmap=STYLE.quantity, vmin=min(0.0, float(values.min())), origin="lower")
    label_axes(axis, title=title, x="column", y="row")
    figure.colorbar(image, ax=axis, shrink=0.85).ax.tick_params(labelsize=8)
