"""Causal inverse filter of a sensor with a short, stated delay, for live use.

A zero-phase inverse with a 20 Hz high-pass needs 100 ms of future samples. With only `delay` seconds of them, the best
filter of a given length is the least-squares (Wiener) filter (Wiener, Extrapolation, Interpolation, and Smoothing of
Stationary Time Series, 1949; Oppenheim and Verghese, Signals, Systems and Inference, 11). `causal_error` gives its
error.
"""

from collections.abc import Sequence

import numpy as np

from midair.array_types import Array
from midair.calibration.apply.inverse import check_band_covered, inverse_response, regularised_power
from midair.dsp import Band, band_edges, band_window, check_band, fft_frequencies
from midair.errors import InputError, ShapeError
from midair.model import BAND, Calibration

_BINS = 16
"""Frequencies in the fit per filter tap."""

PARTS = ((BAND[0], 40.0), (40.0, 100.0), (100.0, BAND[1]))
"""Parts of the band, in Hz, in which `causal_error` is computed."""


def causal_fir(
    calibration: Calibration,
    rate: float,
    band: Band = BAND,
    *,
    delay: float = 0.006,
    taps: int = 256,
    below: float = 10.0,
    floor: float = 0.05,
    edges: tuple[float, float] | None = None,
) -> Array:
    """Compute the causal least-squares filter of a given length and delay that inverts a sensor within a band.

    The filter W minimises ``sum over f of phi (|H W - B exp(-j 2 pi f delay)|^2 + eps |W|^2)``. With a long delay it is
    `inverse_response`, delayed. The weight phi = 1 + (below / f)^3 models the input spectrum: a hand that presses and
    drifts is far stronger below 10 Hz than any texture in the band, and would otherwise leak through. If the band
    excludes 0 Hz, a constant input (such as a converter's offset) gives exactly 0.

    Parameters
    ----------
    calibration : Calibration
        Provides H, and the noise in eps.
    rate : float
        Frame rate in Hz.
    band, edges, floor
        As in `calibrate`.
    delay : float
        In s; at most half of the filter's length.
    taps : int
        Length of the filter; at 1 kHz, 256 taps match the result of 1024 to 1 %.
    below : float
        Corner of phi in Hz; 0 for a flat phi.

    Returns
    -------
    ndarray, shape (taps, row, column)
        In Pa per unit of the output.

    Raises
    ------
    BandError
        If the band does not fit the rate or the calibration.
    InputError
        If delay, taps or below is out of range.
    """
    from scipy.linalg import solve_toeplitz

    band, edges = _checked(calibration, rate, band, edges, delay, taps)
    if not 0 <= below < np.inf:
        raise InputError(f"below: expected 0 Hz or more, got {below:g} Hz")
    frequency = fft_frequencies(_BINS * taps, rate)
    response = calibration.response_at(frequency)
    # phi diverges at 0 Hz, so it is held constant below 0.5 Hz.
    phi = (1 + (below / np.maximum(frequency, 0.5)) ** 3)[:, None, None]
    late = (band_window(frequency, band, edges=edges) * np.exp(-2j * np.pi * frequency * delay))[:, None, None]
    alike = np.fft.irfft(phi * regularised_power(calibration, response, floor), axis=0)[:taps].reshape(taps, -1)
    wanted = np.fft.irfft(phi * response.conj() * late, axis=0)[:taps].reshape(taps, -1)
    # Rounding errors of the FFTs must not make the matrix of a quiet channel ill conditioned.
    alike[0] *= 1 + 1e-9
    each = [
        solve_toeplitz(column, np.stack([right, np.ones(taps)], axis=1))
        for column, right in zip(alike.T, wanted.T, strict=True)
    ]
    fir, sums = np.stack([two[:, 0] for two in each], axis=1), np.stack([two[:, 1] for two in each], axis=1)
    if not late[0].any():
        # The constraint sum = 0 adds a multiple of A^-1 1 (Lagrange condition; Boyd and Vandenberghe, 10.1.1).
        fir = fir - sums * (fir.sum(axis=0) / sums.sum(axis=0))
    return fir.reshape(taps, *calibration.sensor.shape)


def causal_error(
    fir: Array,
    calibration: Calibration,
    rate: float,
    band: Band = BAND,
    *,
    delay: float,
    parts: Sequence[Band] = PARTS,
    floor: float = 0.05,
    edges: tuple[float, float] | None = None,
) -> Array:
    """Relative rms error of a causal filter against the delayed zero-phase inverse, shape (part,).

    For a flat input spectrum within each part of the band: the root of the sum over f of ``|H W exp(j 2 pi f delay) - H
    W0|^2`` over the sum of ``|H W0|^2``, with W0 from `inverse_response`, in mean square over the channels. An output
    of zeros has the error 1. `fir` is the result of `causal_fir` for the same arguments, and `parts` are (low, high) in
    Hz.
    """
    band, edges = _checked(calibration, rate, band, edges, delay, len(fir))
    frequency = fft_frequencies(_BINS * len(fir), rate)
    response = calibration.response_at(frequency)
    zero_phase = response * inverse_response(calibration, frequency, band, edges=edges, floor=floor)
    ahead = np.exp(2j * np.pi * frequency * delay)[:, None, None]
    wrong = np.abs(response * np.fft.rfft(fir, _BINS * len(fir), axis=0) * ahead - zero_phase) ** 2
    power = np.abs(zero_phase) ** 2
    inside = [(frequency >= low) & (frequency <= high) for low, high in parts]
    return np.array([np.sqrt(wrong[part].sum() / max(power[part].sum(), 1e-300)) for part in inside])


class CausalInverse:
    """Apply the filter of `causal_fir` to a stream, frame by frame, in preallocated memory.

    The attribute `delay` is the delay of the output in s, and `fir` is the filter, shape (256, row, column). The
    parameters and errors are those of `causal_fir`.
    """

    def __init__(self, calibration: Calibration, rate: float, *, band: Band = BAND, delay: float = 0.006) -> None:
        fir = causal_fir(calibration, rate, band, delay=delay)
        self.fir, self.delay, self._shape = fir, delay, calibration.sensor.shape
        flat = fir.reshape(len(fir), -1)
        # Reversed, because the buffer holds the newest frame last.
        self._turned = np.ascontiguousarray(flat[::-1])
        self._taps, self._at = len(fir), 0
        # Every frame is written twice, so the last `taps` frames are always contiguous.
        self._held = np.zeros((2 * self._taps, flat.shape[1]))
        self._began = False

    def step(self, frame: Array, out: Array) -> None:
        """Filter the next frame, shape (channel,), and write the pressure in Pa into `out`, same shape."""
        if not self._began:
            # Assume that the first frame was constant before the stream began.
            self._held[:] = frame
            self._began = True
        at = self._at
        self._held[at], self._held[at + self._taps] = frame, frame
        self._at = (at + 1) % self._taps
        np.einsum("kc,kc->c", self._turned, self._held[at + 1 : at + 1 + self._taps], out=out)

    def push(self, block: Array) -> Array:
        """Filter a block of shape (frame, row, column) and return as many frames in Pa."""
        samples = np.asarray(block, float)
        if samples.ndim != 3 or samples.shape[1:] != self._shape:
            raise ShapeError(f"block: expected shape (frame, {self._shape[0]}, {self._shape[1]}), got {samples.shape}")
        out = np.empty((len(samples), self._held.shape[1]))
        for frame, into in zip(samples.reshape(len(samples), -1), out, strict=True):
            self.step(frame, into)
        return out.reshape(samples.shape)


def _checked(
    calibration: Calibration,
    rate: float,
    band: Band,
    edges: tuple[float, float] | None,
    delay: float,
    taps: int,
) -> tuple[Band, tuple[float, float]]:
    band = check_band(band, rate)
    check_band_covered(calibration, band)
    if taps < 8:
        raise InputError(f"taps: expected 8 or more, got {taps}")
    if not 0 <= delay <= taps / rate / 2:
        raise InputError(
            f"delay: expected 0 to {1e3 * taps / rate / 2:g} ms, half the length of the filter, got {1e3 * delay:g} ms"
        )
    return band, band_edges(band, rate) if edges is None else edges
