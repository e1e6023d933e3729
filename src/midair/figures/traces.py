"""Curves over time and frequency: traces of all channels, spectra, the beam test, sound levels of an exposure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from midair.array_types import Array
from midair.dsp import welch
from midair.figures.style import STYLE, new_figure, plain_axes
from midair.model import PressureFrames
from midair.physics import Exposure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def traces_figure(original: PressureFrames, reproduced: PressureFrames | None = None) -> Figure:
    """Draw the pressure of every channel on one scale, laid out like the cells; the original is the wide line."""
    rows, columns = original.sensor.shape
    simulated = original.provenance.simulated or (reproduced is not None and reproduced.provenance.simulated)
    figure = new_figure(2.5 * columns, 1.35 * rows + 0.6, simulated=simulated)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for channel, axis in enumerate(axes.ravel()):
        row, column = divmod(channel, columns)
        plain_axes(axis)
        # The wide line of the original is seen on both sides of the reproduction.
        wide = {"color": STYLE.original, "linewidth": 0.7 if reproduced is None else 2.0}
        axis.plot(original.time, original.pressure[:, row, column], label="original", **wide)
        if reproduced is not None:
            shown = reproduced.pressure[: original.frames, row, column]
            axis.plot(reproduced.time[: len(shown)], shown, color=STYLE.reproduced, linewidth=0.6, label="re-recorded")
        axis.set_title(f"channel {channel}", fontsize=8, color=STYLE.ink, loc="left", pad=2)
        axis.margins(x=0)
    figure.supxlabel("time (s)", fontsize=9)
    figure.supylabel("pressure (Pa)", fontsize=9)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    if reproduced is not None:
        figure.legend(handles, labels, loc="outside upper left", ncols=2, fontsize=8, frameon=False)
    return figure


def spectra_figure(
    series: Sequence[tuple[str, PressureFrames]], *, channels: Sequence[int] = (2, 6, 10, 14), rectified: bool = True
) -> Figure:
    """Draw power spectra of the calibrated pressure of named recordings at some channels.

    The default channels are the four of the paper, over which the objects passed. With `rectified` only the positive
    pressure is used, as in the paper's Fig. 9.
    """
    colours = (STYLE.original, STYLE.reproduced, STYLE.before)
    simulated = any(frames.provenance.simulated for _, frames in series)
    figure = new_figure(2.7 * len(channels), 2.9, simulated=simulated)
    axes = figure.subplots(1, len(channels), sharex=True, sharey=True, squeeze=False)[0]
    top, levels = -np.inf, list[tuple[Array, Array]]()
    for axis, channel in zip(axes, channels, strict=True):
        plain_axes(axis)
        for (name, frames), colour, width in zip(series, colours, (2.0, 0.7, 0.7), strict=False):
            row, column = divmod(channel, frames.sensor.columns)
            pressure = frames.pressure[:, row, column]
            frequency, density = welch(np.maximum(pressure, 0) if rectified else pressure, frames.rate)
            # 0 Hz is left out: it is no vibration.
            level = 10 * np.log10(np.maximum(density[1:], 1e-12))
            top = max(top, float(level.max()))
            levels.append((frequency[1:], level))
            axis.plot(frequency[1:], level, color=colour, linewidth=width, label=name)
        axis.set_title(f"channel {channel}", fontsize=8, color=STYLE.ink, loc="left")
        axis.margins(x=0)
    axes[0].set_ylim(top - 60, top + 5)
    # Up to the last frequency that is in the picture.
    axes[0].set_xlim(0, max(frequency[level > top - 60].max(initial=1) for frequency, level in levels))
    figure.supxlabel("frequency (Hz)", fontsize=9)
    axes[0].set_ylabel("power density (dB re 1 Pa²/Hz)", fontsize=8)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=len(series), fontsize=8, frameon=False)
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
    axis = plain_axes(figure.subplots(), x="time (s)", y="level (dB re 20 µPa rms)")
    time = np.arange(len(exposure.level)) / exposure.rate
    colours = (STYLE.original, STYLE.reproduced, STYLE.before, "#009e73", "#cc79a7", "#e69f00")
    for number, place in enumerate(exposure.profile.places):
        colour = colours[number % len(colours)]
        # Silent frames are left out: their level at the floor of the scale would stretch the axis.
        heard = exposure.level[:, number] > 0
        label = f"{place.name}, limit {place.limit:g} dB{'' if place.enforced else ' (advice)'}"
        axis.plot(time, np.where(heard, exposure.level[:, number], np.nan), color=colour, linewidth=0.8, label=label)
        axis.axhline(place.limit, color=colour, linewidth=0.8, linestyle="--")
    axis.set_title(exposure.verdict(), fontsize=8, loc="left")
    axis.margins(x=0)
    axis.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure
