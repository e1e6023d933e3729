"""Frequency response from input and output by local polynomial regression: H1 without leakage, for any excitation.

In a narrow band around f_c the spectra of a record obey Y(f) = H(f) X(f) + T(f) + N(f), with T what the record's two
ends leave over (it is as smooth as H), and N the noise. H and T are taken as parabolas in f - f_c and found by least
squares (the local polynomial method; Pintelon and Schoukens, System Identification: a Frequency Domain Approach, 2nd
edition, 7.2). With constants in place of parabolas and without T it is H1 = S_xy / S_xx, averaged over frequency
(Bendat and Piersol, Random Data, 6.1). It holds for noise, for one sweep as for many, and for any mixture of records.

What the fit leaves over is the noise: sigma^2 = |Y - H X - T|^2 / (averages), so that the variance of H is
sigma^2 [(Z^H Z)^-1]_00. For constants that is Bendat and Piersol's (1 - gamma^2) |H|^2 / (gamma^2 n_d) (9.2.3), half
of it each in magnitude and in phase.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import BandError
from midair.validation import positive

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BandSums:
    """The normal equations of one record in every band; those of several records add up.

    Attributes
    ----------
    frequency : ndarray, shape (band,)
        f_c, in Hz.
    gram : ndarray of complex, shape (band, channel, term, term)
        Z^H Z, Z the input's spectrum times powers of (f - f_c).
    cross : ndarray of complex, shape (band, channel, term)
        Z^H Y.
    power : ndarray, shape (band, channel)
        Y^H Y.
    points : ndarray, shape (channel,)
        Frequencies in a band, less those that T takes.
    peaks : ndarray, shape (band, channel)
        Sum of the input's power squared: what it would be if one frequency held all of it is the power squared.
    """

    frequency: Array
    gram: Complex
    cross: Complex
    power: Array
    points: Array
    peaks: Array

    def only(self, channels: NDArray[np.bool_]) -> "BandSums":
        """The same with 0 for all other channels."""
        keep = channels.astype(float)
        return BandSums(
            frequency=self.frequency,
            gram=self.gram * keep[:, None, None],
            cross=self.cross * keep[:, None],
            power=self.power * keep,
            points=self.points * keep,
            peaks=self.peaks * keep,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyResponse:
    """H with its noise and how sure it is.

    Attributes
    ----------
    frequency : ndarray, shape (band,)
        In Hz.
    terms : ndarray of complex, shape (band, channel, term)
        Coefficients of the polynomial in (f - f_c) over half the band's width: output over input.
    uncertainty : ndarray, shape (band, channel)
        Standard uncertainty of the magnitude as a part of it, and of the phase in rad, from the noise alone; infinite
        where the response is 0.
    coherence : ndarray, shape (band, channel)
        Share of the output that the fit explains, 0 to 1; gamma^2 where H does not change within a band.
    noise : ndarray, shape (band, channel)
        One-sided power density of what is left over, in output^2/Hz.
    averages : ndarray, shape (channel,)
        Degrees of freedom (complex ones) of the noise.
    excited : ndarray, shape (band, channel)
        Number of frequencies among which the input's power is as good as evenly spread: (sum P)^2 / sum P^2.
    """

    frequency: Array
    terms: Complex
    uncertainty: Array
    coherence: Array
    noise: Array
    averages: Array
    excited: Array

    @property
    def response(self) -> Complex:
        """H at the middle of each band, shape (band, channel)."""
        return self.terms[..., 0]


def band_sums(x: Array, y: Array, rate: float, *, resolution: float, width: float, order: int = 2) -> BandSums:
    """Normal equations of one record.

    Parameters
    ----------
    x : ndarray, shape (frame, 1) or (frame, channel)
        Input: one for all channels, or one for each.
    y : ndarray, shape (frame, channel)
        Output.
    rate : float
        In Hz.
    resolution : float
        Distance of the bands, in Hz.
    width : float
        Width of a band, in Hz.
    order : int
        Order of the polynomials; -1 leaves T out and takes H as a constant.

    Raises
    ------
    BandError
        If the record is too short for the width.
    """
    frames, terms = len(x), max(order, 0) + 1
    count = round(width * frames / rate)
    # Twice as many frequencies as H and T together have terms.
    if count < 4 * terms:
        raise BandError(
            f"record: expected {4 * terms * rate / width / rate:.3g} s or more for bands of {width:g} Hz, got "
            f"{frames / rate:.3g} s; record longer or give a coarser resolution"
        )
    step = rate / frames
    centres = np.asarray(resolution * (np.arange(int(rate / 2 / resolution)) + 0.5), np.float64)
    first = np.rint(centres / step - (count - 1) / 2).astype(int)
    # Not the bin at 0 Hz: the mean was removed there.
    fits = (first >= 1) & (first + count <= frames // 2 + 1)
    centres, bins = centres[fits], first[fits, None] + np.arange(count)
    offset = (bins * step - centres[:, None]) * 2 / width
    smooth = _polynomials(count, order + 1)
    inputs = _spectrum(x, rate)[bins][..., None] * (offset[..., None] ** np.arange(terms))[:, :, None, :]
    z = _without(smooth, inputs)
    outputs = _without(smooth, _spectrum(y, rate)[bins])
    gram = np.einsum("bmsi,bmsj->bsij", z.conj(), z)
    along = "bmsi,bmc->bci" if x.shape[1] == 1 else "bmci,bmc->bci"
    cross = np.einsum(along, z.conj(), outputs)
    return BandSums(
        frequency=centres,
        gram=np.broadcast_to(gram, (len(centres), y.shape[1], terms, terms)),
        cross=cross,
        power=(np.abs(outputs) ** 2).sum(axis=1),
        points=np.full(y.shape[1], float(count - smooth.shape[1])),
        peaks=np.broadcast_to((np.abs(z[..., 0]) ** 4).sum(axis=1), (len(centres), y.shape[1])),
    )


def solve_sums(parts: Sequence[BandSums]) -> FrequencyResponse:
    """The response that records of the same bands have in common."""
    gram, cross = sum(part.gram for part in parts), sum(part.cross for part in parts)
    power, points = sum(part.power for part in parts), sum(part.points for part in parts)
    gram, cross = np.asarray(gram, np.complex128), np.asarray(cross, np.complex128)
    power, points = np.asarray(power, float), np.asarray(points, float)
    terms = gram.shape[-1]
    size = np.trace(gram, axis1=-2, axis2=-1).real
    # Without any input the equations would be 0 = 0.
    ridge = np.where(size > 0, 1e-13 * size, 1.0)
    inverse = np.linalg.inv(gram + ridge[..., None, None] * np.eye(terms))
    theta = np.einsum("bcij,bcj->bci", inverse, cross)
    rest = np.maximum(power - np.einsum("bci,bci->bc", cross.conj(), theta).real, 0)
    averages = np.maximum(points - terms, 1)
    noise = rest / averages
    response = theta[..., 0]
    spread = np.sqrt(noise * inverse[..., 0, 0].real / 2)
    size, whole = np.abs(response), power / np.maximum(points, 1)
    return FrequencyResponse(
        frequency=parts[0].frequency,
        terms=theta,
        uncertainty=np.divide(spread, size, out=np.full_like(spread, np.inf), where=size > 0),
        coherence=np.clip(1 - np.divide(noise, whole, out=np.ones_like(whole), where=whole > 0), 0, 1),
        noise=noise,
        averages=averages,
        excited=_ratio(gram[..., 0, 0].real ** 2, np.asarray(sum(part.peaks for part in parts), float)),
    )


def widened(uncertainty: Array, freedom: Array | float) -> Array:
    """A standard uncertainty of few degrees of freedom, widened so that twice it covers 95 % (GUM, G.3: Student's t).

    Parameters
    ----------
    uncertainty : ndarray
        Standard uncertainty that rests on `freedom` degrees of freedom.
    freedom : float or ndarray
        1 or more.
    """
    from scipy.special import ndtri, stdtrit

    return uncertainty * stdtrit(np.maximum(freedom, 1.0), 0.975) / ndtri(0.975)


def check_resolution(resolution: float, width: float | None) -> tuple[float, float]:
    """Distance and width of the bands, in Hz; twice the distance wide if no width is given."""
    step = positive(resolution, "resolution", "Hz")
    return step, 2 * step if width is None else positive(width, "width of a band", "Hz")


def _ratio(above: Array, below: Array) -> Array:
    """The quotient of two arrays, and 0 where the lower one is 0."""
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)


def _spectrum(signal: Array, rate: float) -> Complex:
    """FFT scaled so that its mean square is the one-sided power density, the mean of the signal removed."""
    from scipy.fft import rfft

    return np.asarray(rfft(signal - signal.mean(axis=0), axis=0) * np.sqrt(2 / (rate * len(signal))), np.complex128)


def _polynomials(count: int, terms: int) -> Array:
    """Orthonormal polynomials of degree 0 to terms - 1 over `count` points, shape (count, terms)."""
    place = np.linspace(-1, 1, count)[:, None]
    return np.linalg.qr(place ** np.arange(terms))[0]


def _without(smooth: Array, spectra: Complex) -> Complex:
    """What of the spectra, shape (band, point, ...), no polynomial explains."""
    flat = spectra.reshape(*spectra.shape[:2], -1)
    return (flat - smooth @ (smooth.T @ flat)).reshape(spectra.shape)
