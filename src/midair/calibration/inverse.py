"""Regularised inverse filter of each sensor channel within a band, of zero phase or causal with a short delay.

W(f) = H*(f) B(f) / (|H(f)|^2 + eps), eps = (n / floor)^2: the regularised (Wiener) inverse for a signal with the flat
density `floor` (Oppenheim and Verghese, Signals, Systems and Inference, 11). A pressure of density `floor` in noise of
the same size is halved; for a sensitive channel, W equals 1 / H to (noise-equivalent pressure / floor)^2. W does not
depend on the recording, so all recordings are treated alike.
"""

from collections.abc import Sequence

import numpy as np
import scipy

from midair.array_types import Array, Complex
from midair.dsp import Band, band_edges, band_window, check_band, fft_frequencies
from midair.errors import BandError, InputError, ShapeError
from midair.model import BAND, Calibration, Crosstalk
from midair.validation import positive, within


def inverse_response(
    calibration: Calibration, frequency: Array, band: Band, *, edges: tuple[float, float], floor: float = 0.05
) -> Complex:
    """Compute W(f) of every channel, complex, shape (bin, row, column), in Pa per unit of the output.

    The calibration provides H and n, the noise density at the output. `band` and `edges` are the corners and edges of
    B(f) in Hz, see `midair.dsp.band_window`; `floor` is the density of the weakest relevant pressure, in Pa/sqrt(Hz).
    """
    response = calibration.response_at(frequency)
    below = regularised_power(calibration, response, floor)
    return response.conj() * band_window(frequency, band, edges=edges)[:, None, None] / below


def regularised_power(calibration: Calibration, response: Complex, floor: float) -> Array:
    """Compute |H|^2 + eps, the denominator of the regularised inverse; same shape as the response."""
    eps = (calibration.noise / positive(floor, "floor", "Pa/sqrt(Hz)")) ** 2
    # Avoid 0 / 0 for a noiseless channel with a response of 0: limit eps to -240 dB of its largest response.
    nothing = 1e-24 * (np.abs(calibration.response) ** 2).max(axis=0)
    return np.abs(response) ** 2 + np.maximum(eps, np.where(nothing > 0, nothing, 1.0))


def check_band_covered(calibration: Calibration, band: Band) -> None:
    """Raise a BandError if the calibration does not cover the band."""
    first, last = calibration.frequency[0], calibration.frequency[-1]
    if band[0] < first or band[1] > last:
        raise BandError(
            f"band: expected one within the calibration's {first:g} to {last:g} Hz, got {band[0]:g} to {band[1]:g} Hz; "
            "narrow the band or measure the response over a wider band"
        )


def undo_matrix(crosstalk: Crosstalk, *, damping: float = 0.0) -> Array:
    """Compute the damped inverse of a crosstalk matrix C: (C^T C + d^2)^-1 (C^T + d^2), shape (channel, channel).

    With a damping d = 0 this is the inverse. A large d leaves the pressure unchanged (Tikhonov regularisation towards
    no crosstalk), so that nearly identical rows do not amplify noise. Multiply the matrix with the pressures of all
    channels. Raises InputError if the damping is negative, or the matrix cannot be inverted.
    """
    within(damping, "damping", 0)
    matrix, extra = crosstalk.matrix, damping**2 * np.eye(len(crosstalk.matrix))
    normal = matrix.T @ matrix + extra
    # The condition number of C^T C is the square of that of C.
    condition = float(np.sqrt(np.linalg.cond(normal)))
    if condition > 1e6:
        raise InputError(
            f"crosstalk: expected an invertible matrix, got a condition number of {condition:.2g}; set a damping"
        )
    return np.asarray(np.linalg.solve(normal, matrix.T + extra), np.float64)


def crosstalk_inverse(calibration: Calibration, crosstalk: str, damping: float) -> Array | None:
    """Return the matrix that undoes a calibration's crosstalk, or None for crosstalk = "keep"."""
    if crosstalk == "keep":
        return None
    if crosstalk != "undo":
        raise InputError(f"crosstalk: expected keep or undo, got {crosstalk!r}")
    if calibration.crosstalk is None:
        raise InputError(
            "crosstalk: expected a calibration with a crosstalk matrix, got none; press on each cell alone"
        )
    return undo_matrix(calibration.crosstalk, damping=damping)


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

    A zero-phase inverse with a 20 Hz high-pass needs 100 ms of future samples. With only `delay` seconds of them, the
    best filter of a given length is the least-squares (Wiener) filter (Wiener, Extrapolation, Interpolation, and
    Smoothing of Stationary Time Series, 1949; Oppenheim and Verghese, Signals, Systems and Inference, 11).

    The filter W minimises ``sum over f of phi (|H W - B exp(-j 2 pi f delay)|^2 + eps |W|^2)``. With a long delay it is
    `inverse_response`, delayed. The weight phi = 1 + (below / f)^3 models the input spectrum: a hand that presses and
    drifts is far stronger below 10 Hz than any texture in the band, and would otherwise leak through. If the band
    excludes 0 Hz, a constant input (such as a converter's offset) gives exactly 0.

    `calibration` provides H, and the noise in eps; `rate` is the frame rate in Hz; `band`, `edges` and `floor` are as
    in `calibrate`. `delay` in s is at most half of the filter's length, which is `taps`: at 1 kHz, 256 match the result
    of 1024 to 1 %. `below` is the corner of phi in Hz, 0 for a flat phi. Returns the filter in Pa per unit of the
    output, shape (taps, row, column). Raises BandError if the band does not fit the rate or the calibration, InputError
    if delay, taps or below is out of range.
    """
    band, edges = _checked(calibration, rate, band, edges, delay, taps)
    within(below, "below", 0, unit="Hz")
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
        scipy.linalg.solve_toeplitz(column, np.stack([right, np.ones(taps)], axis=1))
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
    calibration: Calibration, rate: float, band: Band, edges: tuple[float, float] | None, delay: float, taps: int
) -> tuple[Band, tuple[float, float]]:
    band = check_band(band, rate)
    check_band_covered(calibration, band)
    within(taps, "taps", 8)
    if not 0 <= delay <= taps / rate / 2:
        raise InputError(
            f"delay: expected 0 to {1e3 * taps / rate / 2:g} ms, half the length of the filter, got {1e3 * delay:g} ms"
        )
    return band, band_edges(band, rate) if edges is None else edges
