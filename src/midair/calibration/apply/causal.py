"""Undo a sensor while it is felt, with a small delay that is stated: what a live mode can wait for.

A filter that undoes a sensor and cuts below 20 Hz without turning phases needs to look 100 ms ahead. One that may look
only `delay` ahead cannot do the same; this is the one of its length that comes closest, the least-squares or Wiener
filter (Wiener, Extrapolation, Interpolation, and Smoothing of Stationary Time Series, 1949; Oppenheim and Verghese,
Signals, Systems and Inference, 11). What it is worth is a number: `causal_error`.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from midair.calibration.apply.inverse import check_reach, heard_power, inverse_response
from midair.calibration.apply.streaming_inverse import mixing
from midair.dsp import Band, band_edges, band_window, check_band, fft_frequencies
from midair.errors import InputError, ShapeError
from midair.model import Calibration

Array = NDArray[np.float64]

_BINS = 16
"""Frequencies at which a filter is fitted, for each of its taps."""


def causal_fir(
    calibration: Calibration,
    rate: float,
    band: Band = (20.0, 470.0),
    *,
    delay: float = 0.006,
    taps: int = 256,
    below: float = 10.0,
    floor: float = 0.05,
    edges: tuple[float, float] | None = None,
) -> Array:
    """The filter of a stated length and delay that comes closest to undoing a sensor within a band.

    Of all filters W it has the least ``sum over f of phi (|H W - B exp(-j 2 pi f delay)|^2 + eps |W|^2)``: with a long
    delay it is `inverse_response`, late by it. phi = 1 + (below / f)^3 is how strong what acts on a sensor is taken to
    be: a hand that presses and drifts is far stronger below 10 Hz than any texture in the band, and would else come
    through. Where the band leaves 0 Hz out, a constant, such as a converter's offset, gives exactly 0.

    Parameters
    ----------
    calibration : Calibration
        H, and the noise in eps.
    rate : float
        Rate of the frames, in Hz.
    band, edges, floor
        As in `calibrate`.
    delay : float
        In s; below half of the filter's length.
    taps : int
        Length of the filter; 256 at 1 kHz do what 1024 do, to a percent.
    below : float
        In Hz; 0 for an even phi.

    Returns
    -------
    ndarray, shape (taps, row, column)
        In Pa per unit of the output.

    Raises
    ------
    BandError
        If the band does not fit the rate or the calibration.
    InputError
        If delay, taps or below make no sense.
    """
    from scipy.linalg import solve_toeplitz

    band, edges = _checked(calibration, rate, band, edges, delay, taps)
    if not 0 <= below < np.inf:
        raise InputError(f"below: expected 0 Hz or more, got {below:g} Hz")
    frequency = fft_frequencies(_BINS * taps, rate)
    response = calibration.response_at(frequency)
    # Below half a hertz it stays as it is, since it has no bound.
    phi = (1 + (below / np.maximum(frequency, 0.5)) ** 3)[:, None, None]
    late = (band_window(frequency, band, edges=edges) * np.exp(-2j * np.pi * frequency * delay))[:, None, None]
    alike = np.fft.irfft(phi * heard_power(calibration, response, floor), axis=0)[:taps].reshape(taps, -1)
    wanted = np.fft.irfft(phi * response.conj() * late, axis=0)[:taps].reshape(taps, -1)
    # Rounding of the transforms, which must not make a matrix of a quiet channel worse than it is.
    alike[0] *= 1 + 1e-9
    each = [
        solve_toeplitz(column, np.stack([right, np.ones(taps)], axis=1))
        for column, right in zip(alike.T, wanted.T, strict=True)
    ]
    fir, sums = np.stack([two[:, 0] for two in each], axis=1), np.stack([two[:, 1] for two in each], axis=1)
    if not late[0].any():
        # The multiple of A^-1 1 is what Lagrange's condition asks for (Boyd and Vandenberghe, 10.1.1).
        fir = fir - sums * (fir.sum(axis=0) / sums.sum(axis=0))
    return fir.reshape(taps, *calibration.sensor.shape)


def causal_error(
    fir: Array,
    calibration: Calibration,
    rate: float,
    band: Band = (20.0, 470.0),
    *,
    delay: float,
    parts: Sequence[Band] = ((20.0, 40.0), (40.0, 100.0), (100.0, 470.0)),
    floor: float = 0.05,
    edges: tuple[float, float] | None = None,
) -> Array:
    """How far what a filter gives is from what the zero-phase inverse gives `delay` later, by part of the band.

    For an even spectrum within each part: the root of the summed squares over f of ``H W exp(j 2 pi f delay) - H W0``
    over those of ``H W0``, with W0 of `inverse_response`; the mean square over channels.

    Parameters
    ----------
    fir : ndarray, shape (taps, row, column)
        From `causal_fir`.
    calibration, rate, band, delay, floor, edges
        As it was made with.
    parts : sequence of tuple of float
        (low, high) of each, in Hz.

    Returns
    -------
    ndarray, shape (part,)
        1 is as bad as silence.
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
    """The filter of `causal_fir` for a stream, frame by frame, in memory that it took once.

    Parameters
    ----------
    calibration : Calibration
        Of the sensor.
    rate : float
        Rate of the frames, in Hz.
    band, delay, taps, below, floor, edges
        As in `causal_fir`.
    crosstalk, damping
        As in `calibrate`.

    Attributes
    ----------
    delay : float
        By which what comes out is late, in s.
    fir : ndarray, shape (taps, row, column)
        The filter.

    Raises
    ------
    BandError, InputError
        As `causal_fir`, or if nobody measured the crosstalk that is to be undone.
    """

    def __init__(
        self,
        calibration: Calibration,
        rate: float,
        *,
        band: Band = (20.0, 470.0),
        delay: float = 0.006,
        taps: int = 256,
        below: float = 10.0,
        floor: float = 0.05,
        edges: tuple[float, float] | None = None,
        crosstalk: str = "keep",
        damping: float = 0.0,
    ) -> None:
        fir = causal_fir(calibration, rate, band, delay=delay, taps=taps, below=below, floor=floor, edges=edges)
        self.fir, self.delay, self._shape = fir, delay, calibration.sensor.shape
        self._mix = mixing(calibration, crosstalk, damping)
        flat = fir.reshape(taps, -1)
        # The newest frame last, as they lie in memory.
        self._turned = np.ascontiguousarray(flat[::-1])
        self._taps, self._at = taps, 0
        # Twice as long, every frame written twice: the last `taps` always lie in one piece.
        self._held = np.zeros((2 * taps, flat.shape[1]))
        self._felt = np.zeros(flat.shape[1])
        self._began = False

    def step(self, frame: Array, out: Array) -> None:
        """Take the next frame, shape (channel,), and write what comes out into `out`, same shape, in Pa."""
        if not self._began:
            # Before the first frame the sensor is taken to have said what it says in it.
            self._held[:] = frame
            self._began = True
        at = self._at
        self._held[at], self._held[at + self._taps] = frame, frame
        self._at = (at + 1) % self._taps
        into = out if self._mix is None else self._felt
        np.einsum("kc,kc->c", self._turned, self._held[at + 1 : at + 1 + self._taps], out=into)
        if self._mix is not None:
            np.dot(self._mix, into, out=out)

    def push(self, block: Array) -> Array:
        """As many frames as came in, shape (frame, row, column), in Pa.

        Raises
        ------
        ShapeError
            If the block does not fit.
        """
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
    check_reach(calibration, band)
    if taps < 8:
        raise InputError(f"taps: expected 8 or more, got {taps}")
    if not 0 <= delay <= taps / rate / 2:
        raise InputError(
            f"delay: expected 0 to {1e3 * taps / rate / 2:g} ms, half the length of the filter, got {1e3 * delay:g} ms"
        )
    return band, band_edges(band, rate) if edges is None else edges
