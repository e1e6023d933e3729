"""What a mapping keeps of the wanted wave, and what it costs."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from midair.dsp import band_edges, band_window, filter_response
from midair.model import PressureFrames
from midair.targets.mapping import half_wave, mapping_of

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingReport:
    """One mapping of one recording, over all cells.

    Attributes
    ----------
    mapping : str
        Its name.
    gain : float
        Gain of the wanted part: best factor from the recorded to the pushed pressure, in the band.
    distortion_ratio : float
        The wanted part over all else in the band, in dB.
    wanted : float
        rms of the wanted part in the strongest cell over the highest pressure pushed.
    mean, peak : float
        Pressure pushed: averaged over time in the cell that is pushed most, and the highest, in Pa.
    on : float
        Part of the frames in which anything is pushed: an array whose transducers are all equally loud is at full power
        in these, whatever the pressure.
    exposure : float
        Sound energy that goes with the pressure, over that of the half-wave mapping at the same gain of the wanted
        part, in dB: radiation pressure goes with the square of sound pressure, so this is the change of the mean level.
    """

    mapping: str
    gain: float
    distortion_ratio: float
    wanted: float
    mean: float
    peak: float
    on: float
    exposure: float

    def figures(self) -> dict[str, str | float]:
        """Every figure by its name."""
        return asdict(self)


def mapping_report(
    pressure: PressureFrames, mapping: str, *, band: tuple[float, float] = (20.0, 470.0)
) -> MappingReport:
    """How a mapping treats a recording.

    Parameters
    ----------
    pressure : PressureFrames
        The recording's pressure, at the rate at which it is mapped.
    mapping : str
        A name in `MAPPINGS`.
    band : tuple of float
        (low, high) of what is wanted, in Hz.

    Raises
    ------
    InputError
        If there is no such mapping.
    """
    x = pressure.pressure
    pushed = mapping_of(mapping, band)(x, pressure.rate)
    wanted, got = _in_band(x, pressure.rate, band), _in_band(pushed, pressure.rate, band)
    power = float((wanted**2).sum())
    gain = float((wanted * got).sum()) / power if power else 0.0
    rest = float(((got - gain * wanted) ** 2).sum())
    peak = float(pushed.max())
    reference = float(half_wave(x).sum())
    # The half-wave mapping keeps half of the wanted part: the same loudness needs twice its pressure.
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
    # Two periods of the lower edge, which is half as wide as `low` and reaches furthest.
    return filter_response(x, rate, lambda f: _column(band_window(f, band, edges=edges), x.ndim), reach=4 / band[0])


def _column(values: Array, axes: int) -> Array:
    return values.reshape(-1, *[1] * (axes - 1))


def _decibels(signal: float, rest: float) -> float:
    if signal <= 0:
        return float("-inf") if rest > 0 else 0.0
    return float(10 * np.log10(signal / rest)) if rest > 0 else float("inf")
