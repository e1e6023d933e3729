"""Fidelity of a delivered pressure: signal to distortion in the band, images above it, and spatial correlation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.dsp import band_energy, band_window, filter_response, resample
from midair.errors import MismatchError
from midair.evaluate.alignment import advance, find_delay
from midair.model import BAND, PressureFrames

Array = NDArray[np.float64]
Band = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fidelity:
    """Fidelity of a delivered pressure."""

    distortion_ratio: float
    """Signal-to-distortion ratio in dB over the cells with a target, with the best gain for each cell."""
    overall_ratio: float
    """The same ratio with one gain and over all cells, so that pressure beside the target counts as distortion."""
    images: float | None
    """Power in the band of the images over that in the band, in dB; None if the rate is too low."""
    spatial_correlation: float
    """Correlation over the cells of the maps of rms pressure in the band, -1 to 1."""
    gain: float
    """Best gain over all cells."""
    delay: float
    """In s."""


def fidelity(
    original: PressureFrames,
    delivered: PressureFrames,
    *,
    band: Band = BAND,
    images: Band = (530.0, 1000.0),
    weakest: float = 20.0,
    judged: tuple[float, float] | None = None,
) -> Fidelity:
    """Compare the delivered pressure with its original.

    Parameters
    ----------
    original, delivered : PressureFrames
        On the same cells; the slower one is resampled to the rate of the faster one.
    band : tuple of float
        (low, high) in Hz; both pressures are filtered to it with sharp edges.
    images : tuple of float
        Band in Hz in which frame steps create images of the signal band.
    weakest : float
        Cells count as targets down to this many dB below the strongest cell.
    judged : tuple of float, optional
        (begin, duration) of the evaluated part, in s of the original; all if None. It is cut after filtering and
        alignment: a perfect piece with a delay of an eighth of a millisecond would otherwise lose samples at its ends
        and reach only 25 to 45 dB.

    Raises
    ------
    MismatchError
        If the cells differ.
    """
    if original.sensor.shape != delivered.sensor.shape:
        raise MismatchError(
            f"delivered: expected the original's {original.sensor.shape} cells, got {delivered.sensor.shape}"
        )
    rate = max(original.rate, delivered.rate)
    x, y = (resample(each.pressure, each.rate, rate) for each in (original, delivered))
    frames = min(len(x), len(y))
    x, y = in_band(x[:frames], rate, band), in_band(y[:frames], rate, band)
    delay = find_delay(x, y, rate, longest=min(0.05, (frames - 1) / rate))
    # Align before fitting a gain, because a delay is no distortion.
    y = advance(y, delay, rate)
    begin, duration = judged or (0.0, frames / rate)
    part = slice(round(begin * rate), round(begin * rate) + round(duration * rate))
    x, y = x[part], y[part]
    power = (x**2).sum(axis=0)
    touched = (power > 0) & (power >= power.max() * 10 ** (-weakest / 10))
    gains = (x * y).sum(axis=0)[touched] / power[touched]
    gain = float((x * y).sum() / max(float(power.sum()), np.finfo(float).tiny))
    missed = y[:, touched] - gains * x[:, touched]
    return Fidelity(
        distortion_ratio=decibels(float((gains**2 * power[touched]).sum()), float((missed**2).sum())),
        overall_ratio=decibels(gain**2 * float(power.sum()), float(((y - gain * x) ** 2).sum())),
        images=image_level(delivered.cut(begin, duration) if judged else delivered, band=band, images=images),
        spatial_correlation=map_correlation(x, y),
        gain=gain,
        delay=delay,
    )


def in_band(pressure: Array, rate: float, band: Band) -> Array:
    """Filter pressure, shape (frame, ...), to a band with sharp edges and without delay."""
    high = min(band[1], rate / 2)
    return filter_response(
        pressure,
        rate,
        lambda f: band_window(f, (band[0], high), edges=(0.0, 0.0)).reshape(-1, *[1] * (pressure.ndim - 1)),
        reach=0.1,
    )


def image_level(delivered: PressureFrames, *, band: Band = BAND, images: Band = (530.0, 1000.0)) -> float | None:
    """Power in the band of the images over that in the band, over all cells, in dB; None if the rate is too low."""
    if delivered.rate < 2 * images[1]:
        return None
    above, within = (float(band_energy(delivered.pressure, delivered.rate, each).sum()) for each in (images, band))
    return decibels(above, within)


def map_correlation(x: Array, y: Array) -> float:
    """Correlation of the maps of rms pressure over the cells; 0 if a map is uniform."""
    a, b = (np.sqrt((each**2).mean(axis=0)).ravel() for each in (x, y))
    a, b = a - a.mean(), b - b.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0 else 0.0


def decibels(signal: float, rest: float) -> float:
    """10 log10(signal / rest); infinite at the limits, never NaN."""
    if signal <= 0:
        return float("-inf")
    return float(10 * np.log10(signal / rest)) if rest > 0 else float("inf")
