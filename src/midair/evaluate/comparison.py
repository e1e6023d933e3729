"""What was felt against what was recorded: waveform, spectrum, level and place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.dsp import welch
from midair.errors import MismatchError, RateError
from midair.evaluate.alignment import advance, find_delay
from midair.evaluate.distortion import decibels
from midair.evaluate.field import peak_position
from midair.evaluate.spectrum import dominant_frequency, spectral_error
from midair.model import PressureFrames, SensorGrid

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """Figures of a reproduction, none of them a single score.

    Attributes
    ----------
    delay : float
        Time by which the reproduction was later, taken out before all else, in s.
    correlation : float
        Correlation of the waveforms over all channels, -1 to 1, about 0 by silence.
    gain : float
        Slope of the best straight line from original to reproduced pressure through 0.
    waveform_error : float
        ||reproduced - original|| / ||original||, nothing refitted.
    distortion_ratio : float
        Signal-to-distortion after the best gain, in dB.
    spectral_error : float
        Level difference of the spectra in the band, weighted by the original's power, in dB (see `spectral_error`).
    peak : tuple of tuple of float
        (x, y) of the cell with the largest rms, original and reproduced, in m. Of cells of the original that are
        equally strong, to 5 %, the one nearest to the reproduction's counts.
    frequency : tuple of float
        Dominant frequency, original and reproduced, in Hz.
    rms : tuple of float
        Rms of the strongest cell, original and reproduced, in Pa.
    channel_correlation, channel_gain : ndarray, shape (row, column)
        The same, cell by cell; 0 where the original is silent.
    simulated : bool
        Whether any part of it was simulated.
    """

    delay: float
    correlation: float
    gain: float
    waveform_error: float
    distortion_ratio: float
    spectral_error: float
    peak: tuple[tuple[float, float], tuple[float, float]]
    frequency: tuple[float, float]
    rms: tuple[float, float]
    channel_correlation: Array
    channel_gain: Array
    simulated: bool

    @property
    def peak_distance(self) -> float:
        """Between the cells with the largest rms, in m."""
        return float(np.hypot(*np.subtract(*self.peak)))

    def figures(self) -> dict[str, tuple[float, str]]:
        """Every scalar figure with its unit, by the words that people read."""
        return {
            "correlation": (self.correlation, ""),
            "gain": (self.gain, ""),
            "waveform error": (100 * self.waveform_error, "%"),
            "signal to distortion": (self.distortion_ratio, "dB"),
            "spectral error": (self.spectral_error, "dB"),
            "peak distance": (1e3 * self.peak_distance, "mm"),
            "dominant frequency, original": (self.frequency[0], "Hz"),
            "dominant frequency, reproduced": (self.frequency[1], "Hz"),
            "rms of the strongest cell, original": (self.rms[0], "Pa"),
            "rms of the strongest cell, reproduced": (self.rms[1], "Pa"),
            "delay": (1e3 * self.delay, "ms"),
        }

    def __repr__(self) -> str:
        said = f"correlation {self.correlation:.3f}, gain {self.gain:.3g}, error {100 * self.waveform_error:.1f} %"
        heard = f"signal to distortion {self.distortion_ratio:.1f} dB, delay {1e3 * self.delay:.2g} ms"
        return f"<Comparison {said}, {heard}{', SIMULATED' if self.simulated else ''}>"


def compare(
    original: PressureFrames,
    reproduced: PressureFrames,
    *,
    longest_delay: float = 0.05,
    band: tuple[float, float] | None = None,
) -> Comparison:
    """Compare a reproduction with its original.

    Parameters
    ----------
    original, reproduced : PressureFrames
        Pressures of the same cells at the same rate; the shorter one decides how many frames are compared.
    longest_delay : float
        Largest delay that is looked for, in s.
    band : tuple of float, optional
        (low, high) of the frequencies whose spectra are compared, in Hz; the original's own band if None.

    Raises
    ------
    MismatchError
        If the sensors have different cells.
    RateError
        If the rates differ; resample one first.
    """
    check_alike(original, reproduced)
    frames = min(original.frames, reproduced.frames)
    x, y = original.pressure[:frames], reproduced.pressure[:frames]
    delay = find_delay(x, y, original.rate, longest=min(longest_delay, (frames - 1) / original.rate))
    # Before all figures: a wave that is half a period late is the opposite of itself.
    y = advance(y, delay, original.rate)
    gain = _gain(x, y, axis=None)
    power_x, power_y = (x**2).mean(axis=0), (y**2).mean(axis=0)
    return Comparison(
        delay=delay,
        correlation=float(_correlation(x, y, axis=None)),
        gain=float(gain),
        waveform_error=_ratio(np.linalg.norm(y - x), np.linalg.norm(x)),
        distortion_ratio=decibels(float(gain) ** 2 * (x**2).sum(), ((y - gain * x) ** 2).sum()),
        spectral_error=_spectral_error(x, y, original.rate, band or original.band),
        peak=_peaks(power_x, power_y, original.sensor),
        frequency=(dominant_frequency(x, original.rate), dominant_frequency(y, original.rate)),
        rms=(float(np.sqrt(power_x.max())), float(np.sqrt(power_y.max()))),
        channel_correlation=_correlation(x, y, axis=0),
        channel_gain=_gain(x, y, axis=0),
        simulated=original.provenance.simulated or reproduced.provenance.simulated,
    )


def _peaks(original: Array, reproduced: Array, sensor: SensorGrid) -> tuple[tuple[float, float], tuple[float, float]]:
    """Places of the largest mean square, shape (row, column) each; see `Comparison.peak`."""
    found = peak_position(reproduced, sensor)
    # Squared, since these are mean squares and 5 % is meant of the rms.
    rows, columns = np.nonzero(original >= 0.95**2 * original.max())
    away = np.hypot(sensor.x[columns] - found[0], sensor.y[rows] - found[1])
    nearest = int(np.argmin(away))
    return (float(sensor.x[columns[nearest]]), float(sensor.y[rows[nearest]])), found


def check_alike(original: PressureFrames, reproduced: PressureFrames) -> None:
    """Refuse other cells (MismatchError) and other rates (RateError)."""
    if original.sensor.shape != reproduced.sensor.shape:
        raise MismatchError(
            f"reproduced: expected the original's {original.sensor.shape} cells, got {reproduced.sensor.shape}"
        )
    if not np.isclose(original.rate, reproduced.rate, rtol=1e-6):
        raise RateError(
            f"reproduced: expected the original's {original.rate:g} Hz, got {reproduced.rate:g} Hz; resample one first"
        )


def _spectral_error(x: Array, y: Array, rate: float, band: tuple[float, float] | None) -> float:
    frequency, before = welch(x, rate)
    _, after = welch(y, rate)
    low, high = band or (0.0, rate / 2)
    inside = (frequency >= low) & (frequency <= high)
    return spectral_error(before[inside], after[inside])


def _gain(x: Array, y: Array, axis: int | None) -> Array:
    power = (x**2).sum(axis=axis)
    return np.divide((x * y).sum(axis=axis), power, out=np.zeros_like(power), where=power > 0)


def _correlation(x: Array, y: Array, axis: int | None) -> Array:
    norm = np.sqrt((x**2).sum(axis=axis) * (y**2).sum(axis=axis))
    return np.divide((x * y).sum(axis=axis), norm, out=np.zeros_like(norm), where=norm > 0)


def _ratio(part: np.floating, whole: np.floating) -> float:
    return float(part / whole) if whole > 0 else (0.0 if part == 0 else float("inf"))
