"""Apply a calibration block by block during recording, with a stated delay."""

import numpy as np
from numpy.typing import NDArray

from midair.calibration.apply.crosstalk_inverse import undo_matrix
from midair.calibration.apply.inverse import check_band_covered, inverse_fir
from midair.dsp import Band, band_edges, check_band
from midair.errors import InputError, ShapeError
from midair.model import BAND, Calibration
from midair.validation import frozen_array

Array = NDArray[np.float64]


class StreamingInverse:
    """Apply the filter of ``calibrate(method="fir")`` to a stream: the same frames, `delay` seconds later.

    For any block lengths, the outputs of `push` and `finish` together equal `calibrate` on the whole recording with the
    same band and taps, to rounding (1e-9 of the peak). The result differs from the default FFT method by .4 % rms with
    the default taps, see `calibrate`. The filter is symmetric around `delay`, except for the phase that it inverts.

    Parameters
    ----------
    rate : float
        Frame rate in Hz.
    band : tuple of float
        (low, high) in Hz.
    taps : int, optional
        Odd; by default two periods of the narrowest edge: 201 at 1 kHz, a delay of 100 ms.
    edges, floor, crosstalk, damping
        As in `calibrate`.

    Raises
    ------
    BandError
        If the band does not fit the rate or the calibration.
    InputError
        If taps, floor or damping is out of range, or the calibration has no crosstalk matrix to undo.
    """

    def __init__(
        self,
        calibration: Calibration,
        rate: float,
        *,
        band: Band = BAND,
        taps: int | None = None,
        edges: tuple[float, float] | None = None,
        floor: float = 0.05,
        crosstalk: str = "keep",
        damping: float = 0.0,
    ) -> None:
        band = check_band(band, rate)
        check_band_covered(calibration, band)
        edges = band_edges(band, rate) if edges is None else edges
        fir = inverse_fir(calibration, rate, band, edges=edges, taps=taps, floor=floor)
        self._shape = calibration.sensor.shape
        self._fir = fir.reshape(len(fir), -1)
        self._mix = crosstalk_inverse(calibration, crosstalk, damping)
        self._held = np.zeros((0, self._fir.shape[1]))
        self.delay = (len(fir) - 1) / 2 / rate

    def push(self, block: Array) -> Array:
        """Take a block of shape (frame, row, column) and return the frames that are ready, possibly none, in Pa.

        Raises
        ------
        ShapeError, NonFiniteError
            If the block is invalid; then no frame of it is used.
        """
        samples = np.asarray(block, float)
        if samples.ndim != 3 or samples.shape[1:] != self._shape:
            raise ShapeError(f"block: expected shape (frame, {self._shape[0]}, {self._shape[1]}), got {samples.shape}")
        if not len(samples):
            return samples
        flat = frozen_array(samples, "block", ("frame", *self._shape)).reshape(len(samples), -1)
        if not len(self._held):
            # Assume that the first frame was constant before the stream began.
            self._held = np.repeat(flat[:1], len(self._fir) // 2, axis=0)
        return self._filter(flat)

    def finish(self) -> Array:
        """Return the remaining frames, shape (frame, row, column), in Pa, as if the last input frame were repeated.

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
        # Keep the history that the next output frame needs.
        self._held = held[max(0, len(held) - len(self._fir) + 1) :]
        if len(held) < len(self._fir):
            return np.zeros((0, *self._shape))
        pressure = np.asarray(oaconvolve(held, self._fir, mode="valid", axes=0), np.float64)
        return (pressure if self._mix is None else pressure @ self._mix.T).reshape(-1, *self._shape)


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
