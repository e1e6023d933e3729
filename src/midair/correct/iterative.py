"""Iterative correction: the error of a re-recording is added to the commanded pressure, frequency by frequency.

    U <- proj[ U + g conj(H) / (|H|^2 + eps) (Y_target - Y) ]

U is the commanded pressure, Y its re-recording, H the response from one to the other, proj the nearest pressure that
can be played. In iterative learning control this is learning by an inverted model (Bristow, Tharayil and Alleyne, IEEE
Control Systems 26(3), 2006), regularised where H is small.
"""

from dataclasses import dataclass

import numpy as np

from midair.array_types import Array, Complex
from midair.dsp import Band, band_edges, band_window, filter_response
from midair.errors import InputError, ShapeError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Transfer function from commanded to re-recorded pressure, the same for all cells."""

    frequency: Array
    """Increasing, in Hz, shape (bin,)."""
    value: Complex
    """H in Pa/Pa, shape (bin,)."""

    def at(self, frequency: Array) -> Complex:
        """H between the bins, by linear interpolation of its real and imaginary parts; constant beyond the ends."""
        real, imaginary = (np.interp(frequency, self.frequency, part) for part in (self.value.real, self.value.imag))
        return np.asarray(real + 1j * imaginary, np.complex128)


def measured_response(asked: Array, heard: Array, rate: float, *, band: Band, resolution: float = 20.0) -> Response:
    """H1 = S_uy / S_uu by Welch's method, the cross-spectra summed over the cells.

    Bins with less than 1e-4 of the strongest bin's power contain no information; they take H of the nearest bin with
    more, and bins outside the band (low, high) are ignored. H is assumed smooth over the spacing of the bins,
    `resolution`; all frequencies are in Hz. `asked` and `heard`, shape (frame, row, column), are the commanded and the
    re-recorded pressure in Pa, at the same times. Raises ShapeError if their shapes differ and InputError if the
    commanded pressure is zero in the band.
    """
    from scipy.signal import csd
    from scipy.signal import welch as scipy_welch

    if asked.shape != heard.shape:
        raise ShapeError(f"heard: expected the shape of the commanded pressure, {asked.shape}, got {heard.shape}")
    segment = min(len(asked), max(8, round(rate / resolution)))
    u, y = asked.reshape(len(asked), -1), heard.reshape(len(heard), -1)
    frequency, power = scipy_welch(u, rate, nperseg=segment, axis=0)
    _, cross = csd(u, y, rate, nperseg=segment, axis=0)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    # Summed before the ratio, so that cells with little pressure do not make it noisy.
    power, cross = power.sum(axis=1) * inside, cross.sum(axis=1)
    if not power.max() > 0:
        raise InputError(f"asked: expected pressure within {band[0]:g} to {band[1]:g} Hz, got none")
    good = np.flatnonzero(power > 1e-4 * power.max())
    nearest = good[np.argmin(np.abs(np.arange(len(frequency))[:, None] - good), axis=1)]
    return Response(
        frequency=np.asarray(frequency, np.float64),
        value=np.asarray((cross[good] / power[good])[np.searchsorted(good, nearest)]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class IterativeCorrection:
    """Settings of the correction."""

    step: float = 0.8
    """g of the first step; 1 would be exact for a linear chain and an exact H."""
    regularisation: float = 0.01
    """eps, over the largest ``|H|^2`` in the band."""
    shrink: float = 0.5
    """Factor on g after a step that increased the error and was undone."""
    smallest: float = 0.1
    """The correction stops below this g."""
    least: float = 0.002
    """Fraction of the error by which a step must lower it to continue."""

    def __post_init__(self) -> None:
        if not (0 < self.smallest <= self.step <= 2 and 0 < self.shrink < 1):
            raise InputError(
                f"correction: expected 0 < smallest <= step <= 2 and 0 < shrink < 1, got {self.smallest:g}, "
                f"{self.step:g} and {self.shrink:g}"
            )
        if self.regularisation < 0 or not 0 <= self.least < 1:
            raise InputError(
                f"correction: expected regularisation >= 0 and 0 <= least < 1, got {self.regularisation:g} and "
                f"{self.least:g}"
            )

    def change(self, lacking: Array, rate: float, response: Response, *, band: Band, step: float) -> Array:
        """Change of the commanded pressure: ``g conj(H) / (|H|^2 + eps)`` applied to the error, within the band.

        `lacking`, shape (frame, row, column), is Y_target - Y at the same times, in Pa; `rate` and the `band` (low,
        high), with the usual soft edges, are in Hz; `response` is H and `step` is g.
        """
        edges = band_edges(band, rate)
        within = (response.frequency >= band[0]) & (response.frequency <= band[1])
        power = np.abs(response.value) ** 2
        floor = self.regularisation * float(power[within].max() if within.any() else power.max())

        def inverse(frequency: Array) -> Complex:
            H = response.at(frequency)
            gain = step * band_window(frequency, band, edges=edges) * np.conj(H) / (np.abs(H) ** 2 + floor)
            return np.asarray(gain, np.complex128).reshape(-1, 1, 1)

        return filter_response(lacking, rate, inverse, reach=0.1)
