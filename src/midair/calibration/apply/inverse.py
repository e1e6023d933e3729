"""Regularised inverse filter of each sensor channel within a band.

W(f) = H*(f) B(f) / (|H(f)|^2 + eps), eps = (n / floor)^2: the regularised (Wiener) inverse for a signal with the flat
density `floor` (Oppenheim and Verghese, Signals, Systems and Inference, 11). A pressure of density `floor` in noise of
the same size is halved; for a sensitive channel, W equals 1 / H to (noise-equivalent pressure / floor)^2. W does not
depend on the recording, so all recordings are treated alike.
"""

import numpy as np

from midair.array_types import Array, Complex
from midair.dsp import Band, band_window, fft_frequencies, fir_from_response
from midair.errors import BandError, InputError
from midair.model import Calibration, Crosstalk
from midair.validation import positive


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


def inverse_fir(
    calibration: Calibration,
    rate: float,
    band: Band,
    *,
    edges: tuple[float, float],
    taps: int | None = None,
    floor: float = 0.05,
) -> Array:
    """Compute W(f) as a FIR filter for a stream; it inverts the phase of H and delays by (taps - 1) / 2 frames.

    It is the least-squares fit of that length; where B(0) = 0, with the constraint that a constant input gives exactly
    0. The result has the shape (taps, row, column), in Pa per unit of the output. `taps` is odd, and `default_taps` by
    default; the other parameters are as in `inverse_response`.
    """
    taps = default_taps(rate, edges) if taps is None else taps
    if taps < 3 or taps % 2 == 0:
        raise InputError(f"taps: expected an odd number of 3 or more, got {taps}; use {max(taps + 1, 3)}")
    # Enough frequencies for the impulse response to decay before it wraps around.
    length = 2 ** int(np.ceil(np.log2(16 * max(taps, default_taps(rate, edges)))))
    frequency = fft_frequencies(length, rate)
    wanted = inverse_response(calibration, frequency, band, edges=edges, floor=floor)
    fir = fir_from_response(wanted, taps)
    # Subtracting the mean is the smallest change (in least squares) that makes the sum 0.
    return fir if wanted[0].any() else fir - fir.mean(axis=0)


def check_band_covered(calibration: Calibration, band: Band) -> None:
    """Raise a BandError if the calibration does not cover the band."""
    first, last = calibration.frequency[0], calibration.frequency[-1]
    if band[0] < first or band[1] > last:
        raise BandError(
            f"band: expected one within the calibration's {first:g} to {last:g} Hz, got {band[0]:g} to {band[1]:g} Hz; "
            "narrow the band or measure the response over a wider band"
        )


def default_taps(rate: float, edges: tuple[float, float]) -> int:
    """Odd number of taps that spans two periods of the narrowest edge: 201 at 1 kHz for an edge of 10 Hz."""
    widths = [width for width in edges if width > 0]
    return 2 * int(np.ceil(rate / min(widths))) + 1 if widths else 201


def undo_matrix(crosstalk: Crosstalk, *, damping: float = 0.0) -> Array:
    """Compute the damped inverse of a crosstalk matrix C: (C^T C + d^2)^-1 (C^T + d^2), shape (channel, channel).

    With a damping d = 0 this is the inverse. A large d leaves the pressure unchanged (Tikhonov regularisation towards
    no crosstalk), so that nearly identical rows do not amplify noise. Multiply the matrix with the pressures of all
    channels. Raises InputError if the damping is negative, or the matrix cannot be inverted.
    """
    if not 0 <= damping < np.inf:
        raise InputError(f"damping: expected 0 or more, got {damping:g}")
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
