"""Undo a sensor while it is recorded, block by block, with a stated delay."""

import numpy as np
from numpy.typing import NDArray

from midair.calibration.apply.crosstalk_inverse import undo_matrix
from midair.calibration.apply.inverse import check_reach, inverse_fir
from midair.dsp import Band, band_edges, check_band
from midair.errors import InputError, ShapeError
from midair.model import Calibration
from midair.validation import frozen_array

Array = NDArray[np.float64]


class StreamingInverse:
    """The filter of ``calibrate(method="fir")`` for a stream: the same frames, `delay` later.

    Whatever the lengths of the blocks, what comes out of `push` and `finish` together is what `calibrate` makes of the
    whole recording with the same band and taps, to rounding (1e-9 of its peak); against its default, the FFT, it is
    right to .4 % rms with the default taps, see `calibrate`.

    Parameters
    ----------
    calibration : Calibration
        Calibration of the sensor.
    rate : float
        Rate of the frames, in Hz.
    band : tuple of float
        (low, high), in Hz.
    taps : int, optional
        Odd; two periods of the narrowest edge if None: 201 at 1 kHz, so that the delay is 100 ms.
    edges, floor
        As in `calibrate`.
    crosstalk : {"keep", "undo"}
        Whether to undo what the cells feel of each other.
    damping : float
        See `midair.calibration.undo_matrix`.

    Raises
    ------
    BandError
        If the band does not fit the rate or the calibration.
    InputError
        If taps, floor or damping make no sense, or nobody measured the crosstalk that is to be undone.

    Attributes
    ----------
    delay : float
        Time between a frame's going in and its coming out, in s; the filter is symmetric around it but for the phase
        that it undoes.
    """

    def __init__(
        self,
        calibration: Calibration,
        rate: float,
        *,
        band: Band = (20.0, 470.0),
        taps: int | None = None,
        edges: tuple[float, float] | None = None,
        floor: float = 0.05,
        crosstalk: str = "keep",
        damping: float = 0.0,
    ) -> None:
        band = check_band(band, rate)
        check_reach(calibration, band)
        edges = band_edges(band, rate) if edges is None else edges
        fir = inverse_fir(calibration, rate, band, edges=edges, taps=taps, floor=floor)
        self._shape = calibration.sensor.shape
        self._fir = fir.reshape(len(fir), -1)
        self._mix = mixing(calibration, crosstalk, damping)
        self._held = np.zeros((0, self._fir.shape[1]))
        self.delay = (len(fir) - 1) / 2 / rate

    def push(self, block: Array) -> Array:
        """Take the next frames, shape (frame, row, column); those that are ready, in Pa, may be fewer, later none.

        Raises
        ------
        ShapeError, NonFiniteError
            If the block does not fit; nothing of it is taken.
        """
        samples = np.asarray(block, float)
        if samples.ndim != 3 or samples.shape[1:] != self._shape:
            raise ShapeError(f"block: expected shape (frame, {self._shape[0]}, {self._shape[1]}), got {samples.shape}")
        if not len(samples):
            return samples
        flat = frozen_array(samples, "block", ("frame", *self._shape)).reshape(len(samples), -1)
        if not len(self._held):
            # Before the first frame the sensor is taken to have said what it says in it.
            self._held = np.repeat(flat[:1], len(self._fir) // 2, axis=0)
        return self._filter(flat)

    def finish(self) -> Array:
        """The frames that are still inside, as if the last one were held, shape (frame, row, column), in Pa.

        The next `push` begins a new stream.
        """
        if not len(self._held):
            return np.zeros((0, *self._shape))
        last = self._filter(np.repeat(self._held[-1:], len(self._fir) // 2, axis=0))
        self._held = np.zeros((0, self._fir.shape[1]))
        return last

    def _filter(self, flat: Array) -> Array:
        from scipy.signal import oaconvolve

        held = np.concatenate([self._held, flat])
        # As many as the next frame out needs before the next frame in.
        self._held = held[max(0, len(held) - len(self._fir) + 1) :]
        if len(held) < len(self._fir):
            return np.zeros((0, *self._shape))
        pressure = np.asarray(oaconvolve(held, self._fir, mode="valid", axes=0), np.float64)
        return (pressure if self._mix is None else pressure @ self._mix.T).reshape(-1, *self._shape)


def mixing(calibration: Calibration, crosstalk: str, damping: float) -> Array | None:
    """The matrix that undoes a calibration's crosstalk, or None when it is to be kept.

    Raises
    ------
    InputError
        If it is neither to be kept nor undone, or nobody measured it.
    """
    if crosstalk == "keep":
        return None
    if crosstalk != "undo":
        raise InputError(f"crosstalk: expected keep or undo, got {crosstalk!r}")
    if calibration.crosstalk is None:
        raise InputError("crosstalk: expected a calibration that knows it, got one that does not; press on each cell")
    return undo_matrix(calibration.crosstalk, damping=damping)
