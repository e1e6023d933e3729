"""The filter that undoes a sensor: regularised inverse of each channel's response, within a band.

W(f) = H*(f) B(f) / (|H(f)|^2 + eps), eps = (n / floor)^2, the classical regularised (Wiener) inverse with a signal of
even density `floor` (Oppenheim and Verghese, Signals, Systems and Inference, 11): a pressure of `floor` that is buried
in a noise of the same size comes out halved; where the channel hears well, W is 1 / H to (noise-equivalent pressure /
floor)^2. It does not depend on the recording, so that two recordings are undone in the same way.
"""

import numpy as np
from numpy.typing import NDArray

from midair.dsp import Band, band_window, fft_frequencies, fir_from_response
from midair.errors import BandError, InputError
from midair.model import Calibration
from midair.validation import positive

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def inverse_response(
    calibration: Calibration, frequency: Array, band: Band, *, edges: tuple[float, float], floor: float = 0.05
) -> Complex:
    """W(f) of every channel.

    Parameters
    ----------
    calibration : Calibration
        H and n, the noise density at the output.
    frequency : ndarray, shape (bin,)
        In Hz.
    band, edges : tuple of float
        Corners and edges of B(f), see `midair.dsp.band_window`, in Hz.
    floor : float
        Density of the weakest pressure worth hearing, in Pa/sqrt(Hz).

    Returns
    -------
    ndarray of complex, shape (bin, row, column)
        In Pa per unit of the output; 0 where a channel hears nothing at all.
    """
    response = calibration.response_at(frequency)
    below = heard_power(calibration, response, floor)
    return response.conj() * band_window(frequency, band, edges=edges)[:, None, None] / below


def heard_power(calibration: Calibration, response: Complex, floor: float) -> Array:
    """|H|^2 + eps of every channel, same shape as the response, by which the regularised inverse divides."""
    eps = (calibration.noise / positive(floor, "floor", "Pa/sqrt(Hz)")) ** 2
    # Without any noise a channel that answers 0 would be 0 / 0: -240 dB of its best answer is as good as nothing.
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
    """W(f) as a filter of finite length, for a stream: it adds a delay of (taps - 1) / 2 frames and undoes H's phase.

    The least-squares fit of that length; where B(0) = 0 also under the condition that a constant gives exactly 0.

    Parameters
    ----------
    calibration, band, edges, floor
        As in `inverse_response`.
    rate : float
        Rate of the frames, in Hz.
    taps : int, optional
        Odd. By default `default_taps`.

    Returns
    -------
    ndarray, shape (taps, row, column)
        In Pa per unit of the output.
    """
    taps = default_taps(rate, edges) if taps is None else taps
    if taps < 3 or taps % 2 == 0:
        raise InputError(f"taps: expected an odd number from 3 on, got {taps}; {max(taps + 1, 3)} would do")
    # So many frequencies that the impulse response has died away before it wraps round.
    length = 2 ** int(np.ceil(np.log2(16 * max(taps, default_taps(rate, edges)))))
    frequency = fft_frequencies(length, rate)
    wanted = inverse_response(calibration, frequency, band, edges=edges, floor=floor)
    fir = fir_from_response(wanted, taps)
    # Of all changes that make the sum 0, the even one is the smallest.
    return fir if wanted[0].any() else fir - fir.mean(axis=0)


def check_reach(calibration: Calibration, band: Band) -> None:
    """Refuse a band in which the response is not known.

    Raises
    ------
    BandError
        If it reaches below the first bin or above the last.
    """
    first, last = calibration.frequency[0], calibration.frequency[-1]
    if band[0] < first or band[1] > last:
        raise BandError(
            f"band: expected one within the calibration's {first:g} to {last:g} Hz, got {band[0]:g} to {band[1]:g} Hz; "
            "narrow the band or measure the response further"
        )


def default_taps(rate: float, edges: tuple[float, float]) -> int:
    """Odd number of taps that spans two periods of the narrowest edge: 201 at 1 kHz with an edge of 10 Hz."""
    widths = [width for width in edges if width > 0]
    return 2 * int(np.ceil(rate / min(widths))) + 1 if widths else 201
