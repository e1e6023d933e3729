"""Compare the signal that a mapping keeps with its distortion and its cost in exposure."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from midair.dsp import band_edges, band_window, filter_response
from midair.model import BAND, PressureFrames
from midair.targets.mapping import half_wave, mapping_of

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingReport:
    """Figures of one mapping of one recording, over all cells."""

    mapping: str
    gain: float
    """Least-squares factor from the recorded to the mapped pressure, in the band."""
    distortion_ratio: float
    """Recorded part over all other parts of the mapped pressure in the band, in dB."""
    wanted: float
    """rms of the recorded part in the strongest cell over the highest mapped pressure."""
    mean: float
    """Mapped pressure averaged over time in the cell with the highest average, in Pa."""
    peak: float
    """Highest mapped pressure in Pa."""
    on: float
    """Fraction of frames that are not silent: with equal amplitudes the array is at full power in all of them."""
    exposure: float
    """Change of the mean sound level relative to the half-wave mapping with the same gain, in dB."""

    def figures(self) -> dict[str, str | float]:
        """All figures by name."""
        return asdict(self)


def mapping_report(pressure: PressureFrames, mapping: str, *, band: tuple[float, float] = BAND) -> MappingReport:
    """Compute the figures of a mapping for a recording at the rate at which it is mapped.

    `band` (low, high) is that of the recorded part, in Hz. Raises InputError if the mapping is unknown.
    """
    x = pressure.pressure
    pushed = mapping_of(mapping, band)(x, pressure.rate)
    wanted, got = _in_band(x, pressure.rate, band), _in_band(pushed, pressure.rate, band)
    power = float((wanted**2).sum())
    gain = float((wanted * got).sum()) / power if power else 0.0
    rest = float(((got - gain * wanted) ** 2).sum())
    peak = float(pushed.max())
    reference = float(half_wave(x).sum())
    # The half-wave mapping keeps about half of the recorded part, so it needs twice the pressure for the same gain.
    return MappingReport(
        mapping=mapping,
        gain=gain,
        distortion_ratio=_decibels(gain**2 * power, rest),
        wanted=float(gain * np.sqrt((wanted**2).mean(axis=0).max()) / peak) if peak else 0.0,
        mean=float(pushed.mean(axis=0).max()),
        peak=peak,
        on=float(np.mean((pushed > 0).reshape(len(pushed), -1).any(axis=1))),
        exposure=_decibels(float(pushed.sum()) * _half_wave_gain(x, wanted, pressure.rate, band), reference * gain),
    )


def _half_wave_gain(x: Array, wanted: Array, rate: float, band: tuple[float, float]) -> float:
    power = float((wanted**2).sum())
    return float((wanted * _in_band(half_wave(x), rate, band)).sum()) / power if power else 0.0


def _in_band(x: Array, rate: float, band: tuple[float, float]) -> Array:
    edges = band_edges(band, rate)
    # Two periods of the lower transition, which is half as wide as `low` and has the longest impulse response.
    return filter_response(x, rate, lambda f: _column(band_window(f, band, edges=edges), x.ndim), reach=4 / band[0])


def _column(values: Array, axes: int) -> Array:
    return values.reshape(-1, *[1] * (axes - 1))


def _decibels(signal: float, rest: float) -> float:
    if signal <= 0:
        return float("-inf") if rest > 0 else 0.0
    return float(10 * np.log10(signal / rest)) if rest > 0 else float("inf")
