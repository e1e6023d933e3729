"""How much of a pressure came through: signal against distortion in the band, images above it, place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.dsp import band_energy, band_window, filter_response, resample
from midair.errors import MismatchError
from midair.evaluate.alignment import advance, find_delay
from midair.model import PressureFrames

Array = NDArray[np.float64]
Band = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fidelity:
    """What came through of a pressure.

    Attributes
    ----------
    distortion_ratio : float
        Signal over distortion within the band, in dB, over the cells that are to feel something: sum ||g x||^2 / sum
        ||y - g x||^2 with the best gain g of each cell and the delay taken out.
    overall_ratio : float
        The same with one gain for all cells, and over all cells: what presses beside the place counts as distortion.
    images : float or None
        Power in the band of the images over that in the band, in dB; None where the rate is too low to tell.
    spatial_correlation : float
        Correlation of the maps of rms pressure in the band, over the cells, -1 to 1.
    gain : float
        Best gain over all cells.
    delay : float
        In s.
    """

    distortion_ratio: float
    overall_ratio: float
    images: float | None
    spatial_correlation: float
    gain: float
    delay: float


def fidelity(
    original: PressureFrames,
    delivered: PressureFrames,
    *,
    band: Band = (20.0, 470.0),
    images: Band = (530.0, 1000.0),
    weakest: float = 20.0,
    judged: tuple[float, float] | None = None,
) -> Fidelity:
    """Compare what was delivered with what was to be delivered.

    Parameters
    ----------
    original, delivered : PressureFrames
        On the same cells; the slower one is brought to the faster one's rate.
    band : tuple of float
        (low, high) that counts, in Hz. Both are cut to it with the same sharp edges.
    images : tuple of float
        Where steps from frame to frame make images of the band, in Hz.
    weakest : float
        By how many dB a cell may be below the strongest one to be among those that are to feel something.
    judged : tuple of float, optional
        (begin, duration) of what counts, in s of the original; all if None. It is cut out when band and delay are: a
        perfect piece that is late by an eighth of a millisecond would lack what was cut off, 25 to 45 dB below.

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
    # Before any gain is fitted: what is only late is not distorted.
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
    """The part within a band, edges included, without delay, shape (frame, ...)."""
    high = min(band[1], rate / 2)
    return filter_response(
        pressure,
        rate,
        lambda f: band_window(f, (band[0], high), edges=(0.0, 0.0)).reshape(-1, *[1] * (pressure.ndim - 1)),
        reach=0.1,
    )


def image_level(
    delivered: PressureFrames, *, band: Band = (20.0, 470.0), images: Band = (530.0, 1000.0)
) -> float | None:
    """Power in the band of the images over that in the band, summed over the cells, in dB; None below twice its end."""
    if delivered.rate < 2 * images[1]:
        return None
    above, within = (float(band_energy(delivered.pressure, delivered.rate, each).sum()) for each in (images, band))
    return decibels(above, within)


def map_correlation(x: Array, y: Array) -> float:
    """Correlation of the maps of rms pressure over the cells; 0 where a map is even."""
    a, b = (np.sqrt((each**2).mean(axis=0)).ravel() for each in (x, y))
    a, b = a - a.mean(), b - b.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0 else 0.0


def decibels(signal: float, rest: float) -> float:
    """10 log10(signal / rest); infinite at the ends, never NaN."""
    if signal <= 0:
        return float("-inf")
    return float(10 * np.log10(signal / rest)) if rest > 0 else float("inf")
