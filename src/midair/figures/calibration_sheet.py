"""A calibration on one page: response, uncertainty, coherence, noise, crosstalk, linearity, delay."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from midair.array_types import Array
from midair.figures.style import STYLE, colour_bar, label_axes, new_figure, plain_axes
from midair.model import Calibration, Crosstalk, Linearity, Measurement

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def calibration_figure(calibration: Calibration) -> Figure:
    """Draw nine panels of a calibration; bands and bars are expanded uncertainties (k = 2)."""
    figure = new_figure(15.0, 11.0, simulated=calibration.provenance.simulated)
    axes = figure.subplots(3, 3)
    measured = calibration.measurement
    _response(axes[0, 0], calibration)
    _deviation(axes[0, 1], calibration)
    _phase(axes[0, 2], calibration)
    _uncertainty(axes[1, 0], calibration, measured)
    _coherence(axes[1, 1], calibration, measured)
    _noise(axes[1, 2], calibration)
    _crosstalk(figure, axes[2, 0], calibration.crosstalk)
    _linearity(axes[2, 1], calibration.linearity)
    _delay(axes[2, 2], measured)
    figure.suptitle(_title(calibration), fontsize=10, x=0.01, ha="left", color=STYLE.ink)
    return figure


def _title(calibration: Calibration) -> str:
    sensor, measured = calibration.sensor, calibration.measurement
    first = (
        f"{sensor.name}, {sensor.rows} x {sensor.columns}, calibration {calibration.identifier}, version "
        f"{calibration.version}, {calibration.date or 'no date'}"
    )
    return f"{first}\n{calibration.provenance.source}{'' if measured is None else f': {measured.method}'}"


def _colours(count: int) -> Array:
    from matplotlib import colormaps

    return np.asarray(colormaps["viridis"](np.linspace(0, 0.92, count)))


def _curves(values: Array) -> Array:
    """Reshape (bin, row, column) to (channel, bin)."""
    return values.reshape(len(values), -1).T


def _line(
    axis: Axes, calibration: Calibration, values: Array, colour: Array, wide: Array | None = None, alpha: float = 0.15
) -> None:
    """Draw a curve with its band, or a dot if there is only one bin."""
    frequency, shown = calibration.frequency, tuple(colour)
    axis.plot(frequency, values, color=shown, linewidth=0.8, marker="o" if len(frequency) == 1 else "", markersize=4)
    if wide is not None:
        axis.fill_between(frequency, values - wide, values + wide, color=shown, alpha=alpha, linewidth=0)


def _heard(calibration: Calibration) -> tuple[Array, list[int]]:
    """Magnitude, shape (channel, bin), and the channels that respond at all frequencies."""
    size = _curves(np.abs(calibration.response))
    return size, [channel for channel, one in enumerate(size) if (one > 0).all()]


def _frequency_axis(axis: Axes, calibration: Calibration, label: str, title: str) -> None:
    plain_axes(axis, title=title, x="frequency (Hz)", y=label)
    low, high = calibration.frequency[[0, -1]]
    if 0 < low < high:
        axis.set_xscale("log")
        ticks = [f for f in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000) if low <= f <= high]
        axis.set_xticks(ticks, [str(f) for f in ticks])
        axis.minorticks_off()
    axis.margins(x=0)


def _response(axis: Axes, calibration: Calibration) -> None:
    _frequency_axis(axis, calibration, f"response ({calibration.unit}/Pa)", "magnitude")
    size, heard = _heard(calibration)
    measured, colours = calibration.measurement, _colours(len(size))
    wide = None if measured is None else 2 * _curves(measured.magnitude_uncertainty)
    for channel in heard:
        _line(axis, calibration, size[channel], colours[channel])
        if wide is not None:
            # A logarithmic axis has no 0: bands end just above it.
            low, high = size[channel] * (1 - np.minimum(wide[channel], 0.99)), size[channel] * (1 + wide[channel])
            axis.fill_between(calibration.frequency, low, high, color=tuple(colours[channel]), alpha=0.15, linewidth=0)
    axis.set_yscale("log")
    from matplotlib.lines import Line2D

    named = list(heard)[:: -(-len(heard) // 16) or 1]
    lines = [Line2D([], [], color=colours[channel], label=str(channel)) for channel in named]
    axis.legend(handles=lines, title="channel", title_fontsize=7, fontsize=7, ncols=4, frameon=False, loc="best")


def _deviation(axis: Axes, calibration: Calibration) -> None:
    """Draw the difference of the channels from their mean; uncertainty shared by all channels is left out."""
    _frequency_axis(axis, calibration, "re mean of the channels (dB)", "difference between channels")
    size, heard = _heard(calibration)
    if not heard:
        return
    mean, colours, measured = size[heard].mean(axis=0), _colours(len(size)), calibration.measurement
    for channel in heard:
        wide = None
        if measured is not None:
            own = _curves(measured.magnitude_uncertainty)[channel] ** 2 - measured.reference_uncertainty**2
            wide = 20 / np.log(10) * 2 * np.sqrt(np.maximum(own, 0))
        _line(axis, calibration, 20 * np.log10(size[channel] / mean), colours[channel], wide, alpha=0.3)


def _phase(axis: Axes, calibration: Calibration) -> None:
    _frequency_axis(axis, calibration, "phase (rad)", "phase")
    _, heard = _heard(calibration)
    phase, colours = np.unwrap(_curves(np.angle(calibration.response)), axis=1), _colours(calibration.sensor.count)
    measured = calibration.measurement
    for channel in heard:
        wide = None if measured is None else 2 * _curves(measured.phase_uncertainty)[channel]
        _line(axis, calibration, phase[channel], colours[channel], wide)


def _uncertainty(axis: Axes, calibration: Calibration, measured: Measurement | None) -> None:
    _frequency_axis(axis, calibration, "uncertainty of the magnitude (%, k = 2)", "uncertainty")
    if measured is None:
        return _absent(axis, "unknown: stated, not measured")
    each = 200 * _curves(measured.magnitude_uncertainty)
    low, high = each.min(axis=0), each.max(axis=0)
    axis.fill_between(calibration.frequency, low, high, color=STYLE.before, alpha=0.4, lw=0, label="all channels")
    axis.plot(calibration.frequency, np.median(each, axis=0), color=STYLE.original, lw=1, label="median")
    axis.axhline(
        200 * measured.reference_uncertainty, color=STYLE.reproduced, lw=1, ls="--", label="reference (shared by all)"
    )
    # A few bins of an insensitive channel must not compress the scale of all others.
    axis.set_ylim(0, max(1.1 * float(np.quantile(each, 0.99)), 220 * measured.reference_uncertainty, 1e-3))
    axis.legend(fontsize=8, frameon=False)
    return None


def _coherence(axis: Axes, calibration: Calibration, measured: Measurement | None) -> None:
    title = "part not explained by the reference; bins above the line are rejected"
    _frequency_axis(axis, calibration, "1 - coherence (1)", title)
    if measured is None:
        return _absent(axis, "not measured")
    lost, colours = np.maximum(1 - _curves(measured.coherence), 1e-9), _colours(calibration.sensor.count)
    for channel in _heard(calibration)[1]:
        _line(axis, calibration, lost[channel], colours[channel])
    # 1 minus the default coherence limit of `MeasureSettings`.
    axis.axhline(0.1, color=STYLE.reproduced, lw=1, ls="--")
    axis.set_yscale("log")
    return None


def _noise(axis: Axes, calibration: Calibration) -> None:
    _frequency_axis(axis, calibration, "noise-equivalent pressure (mPa/√Hz)", "noise floor")
    size, heard = _heard(calibration)
    measured, colours = calibration.measurement, _colours(len(size))
    white = np.broadcast_to(calibration.noise, (len(calibration.frequency), *calibration.noise.shape))
    density = _curves(white if measured is None else measured.noise_density)
    for channel in heard:
        _line(axis, calibration, 1e3 * density[channel] / size[channel], colours[channel])
    if density.max() > 0:
        axis.set_yscale("log")


def _crosstalk(figure: Figure, axis: Axes, crosstalk: Crosstalk | None) -> None:
    label_axes(axis, x="pressed cell (channel)", y="responding channel")
    if crosstalk is None:
        return _absent(axis, "not measured: press each cell separately")
    level = 20 * np.log10(np.maximum(np.abs(crosstalk.matrix), 1e-5))
    axis.imshow(level, cmap=STYLE.quantity, vmin=-60, vmax=0, origin="upper")
    colour_bar(figure, [axis], "crosstalk (dB)")
    away = ~np.eye(len(level), dtype=bool)
    if away.any():
        worst, unsure = np.abs(crosstalk.matrix[away]).max(), 2 * np.median(crosstalk.uncertainty[away])
        axis.set_title(
            f"crosstalk, at most {worst:.3g}, uncertainty {unsure:.1g} (median, k = 2)", fontsize=8, loc="left"
        )
    return None


def _linearity(axis: Axes, linearity: Linearity | None) -> None:
    plain_axes(axis, x="pressure (Pa rms)", y="deviation from the line through 0 (%)")
    if linearity is None:
        return _absent(axis, "not measured: needs five levels or more")
    x, y = _curves(linearity.pressure), _curves(linearity.output)
    gain, colours = linearity.gain.ravel()[:, None], _colours(len(x))
    for channel, away in enumerate(100 * (y / np.where(gain * x == 0, 1, gain * x) - 1)):
        axis.plot(x[channel], away, "o-", color=colours[channel], markersize=3, linewidth=0.7)
    axis.axhline(0, color=STYLE.faint, lw=1)
    worst = int(np.argmax(np.abs(linearity.curvature)))
    bend, unsure = linearity.curvature.ravel()[worst], 2 * linearity.curvature_uncertainty.ravel()[worst]
    title = f"linearity: largest curvature {100 * bend:.2g} ± {100 * unsure:.2g} % (channel {worst})"
    axis.set_title(title, fontsize=8, loc="left")
    return None


def _delay(axis: Axes, measured: Measurement | None) -> None:
    plain_axes(axis, title="delay in the upper half of the band", x="channel", y="delay (ms)")
    if measured is None or not measured.delay.any():
        return _absent(axis, "not measured")
    delay, wide = 1e3 * measured.delay.ravel(), 2e3 * measured.delay_uncertainty.ravel()
    axis.errorbar(np.arange(len(delay)), delay, yerr=wide, fmt="o", color=STYLE.original, markersize=4, capsize=2)
    return None


def _absent(axis: Axes, words: str) -> None:
    axis.text(0.5, 0.5, words, ha="center", va="center", fontsize=9, color=STYLE.ink, transform=axis.transAxes)
    axis.set_xticks([])
    axis.set_yticks([])
