"""Estimate frequency responses with the local polynomial method: H1 without leakage, for any excitation.

In a narrow band around f_c the spectra of a recording obey Y(f) = H(f) X(f) + T(f) + N(f), with T the leakage from the
two ends of the recording (as smooth as H) and N the noise. H and T are modelled as parabolas in f - f_c and fitted by
least squares (Pintelon and Schoukens, System Identification: a Frequency Domain Approach, 2nd edition, 7.2). With
constants instead of parabolas and without T this is H1 = S_xy / S_xx, averaged over frequency (Bendat and Piersol,
Random Data, 6.1). It works for noise, for one or several sweeps, and for any combination of recordings.

The residual is the noise: sigma^2 = |Y - H X - T|^2 / (averages), so the variance of H is sigma^2 [(Z^H Z)^-1]_00. For
constants this equals (1 - gamma^2) |H|^2 / (gamma^2 n_d) (Bendat and Piersol, 9.2.3), one half each in magnitude and
phase.

The linearity of a sensor is a line with an intercept through five levels or more, and its curvature.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.dsp import Band
from midair.errors import BandError, InputError
from midair.model import BAND, Calibration, Linearity, Recording
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BandSums:
    """Normal equations of one recording in every band; the sums of several recordings can be added."""

    frequency: Array
    """f_c in Hz, shape (band,)."""
    gram: Complex
    """Z^H Z, shape (band, channel, term, term), with Z the input's spectrum times powers of (f - f_c)."""
    cross: Complex
    """Z^H Y, shape (band, channel, term)."""
    power: Array
    """Y^H Y, shape (band, channel)."""
    points: Array
    """Frequencies in a band minus the terms of T, shape (channel,)."""
    peaks: Array
    """Sum of the input's squared power, shape (band, channel); measures how many frequencies are excited."""

    def only(self, channels: NDArray[np.bool_]) -> "BandSums":
        """Return a copy with 0 for all other channels."""
        keep = channels.astype(float)
        return replace(
            self,
            gram=self.gram * keep[:, None, None],
            cross=self.cross * keep[:, None],
            power=self.power * keep,
            points=self.points * keep,
            peaks=self.peaks * keep,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyResponse:
    """Frequency response H with noise and uncertainty."""

    frequency: Array
    """In Hz, shape (band,)."""
    terms: Complex
    """Coefficients of the polynomial in (f - f_c) over half the band's width, shape (band, channel, term)."""
    uncertainty: Array
    """Relative standard uncertainty of the magnitude, and of the phase in rad, from noise only; inf where H = 0."""
    coherence: Array
    """Share of the output that the fit explains, 0 to 1; gamma^2 where H is constant within a band."""
    noise: Array
    """One-sided power density of the residual, in output^2/Hz."""
    averages: Array
    """Complex degrees of freedom of the noise, shape (channel,)."""
    excited: Array
    """Effective number of excited frequencies per band: (sum P)^2 / sum P^2."""

    @property
    def response(self) -> Complex:
        """H at the centre of each band, shape (band, channel)."""
        return self.terms[..., 0]


def band_sums(x: Array, y: Array, rate: float, *, resolution: float, width: float, order: int = 2) -> BandSums:
    """Compute the normal equations of one recording, from the input x (frame, 1) and the output y (frame, channel).

    `resolution` is the spacing and `width` the width of the bands in Hz. An order of -1 omits T and makes H constant.
    """
    frames, terms = len(x), max(order, 0) + 1
    count = round(width * frames / rate)
    # Require twice as many frequencies as H and T together have terms.
    if count < 4 * terms:
        raise BandError(
            f"record: expected {4 * terms * rate / width / rate:.3g} s or more for bands of {width:g} Hz, got "
            f"{frames / rate:.3g} s; record longer or choose a coarser resolution"
        )
    step = rate / frames
    centres = np.asarray(resolution * (np.arange(int(rate / 2 / resolution)) + 0.5), np.float64)
    first = np.rint(centres / step - (count - 1) / 2).astype(int)
    # Skip the bin at 0 Hz, because the mean was removed.
    fits = (first >= 1) & (first + count <= frames // 2 + 1)
    centres, bins = centres[fits], first[fits, None] + np.arange(count)
    offset = (bins * step - centres[:, None]) * 2 / width
    # Orthonormal polynomials in the place within a band, for T.
    smooth = np.linalg.qr(np.linspace(-1, 1, count)[:, None] ** np.arange(order + 1))[0]
    inputs = _spectrum(x, rate)[bins][..., None] * (offset[..., None] ** np.arange(terms))[:, :, None, :]
    z = _without(smooth, inputs)
    outputs = _without(smooth, _spectrum(y, rate)[bins])
    gram = np.einsum("bmsi,bmsj->bsij", z.conj(), z)
    cross = np.einsum("bmsi,bmc->bci", z.conj(), outputs)
    return BandSums(
        frequency=centres,
        gram=np.broadcast_to(gram, (len(centres), y.shape[1], terms, terms)),
        cross=cross,
        power=(np.abs(outputs) ** 2).sum(axis=1),
        points=np.full(y.shape[1], float(count - smooth.shape[1])),
        peaks=np.broadcast_to((np.abs(z[..., 0]) ** 4).sum(axis=1), (len(centres), y.shape[1])),
    )


def solve_sums(parts: Sequence[BandSums]) -> FrequencyResponse:
    """Fit one response to all recordings with the same bands."""
    gram, cross = (sum(getattr(part, name) for part in parts) for name in ("gram", "cross"))
    gram, cross = np.asarray(gram, np.complex128), np.asarray(cross, np.complex128)
    sums = (sum(getattr(part, name) for part in parts) for name in ("power", "points", "peaks"))
    power, points, peaks = (np.asarray(each, float) for each in sums)
    terms = gram.shape[-1]
    size = np.trace(gram, axis1=-2, axis2=-1).real
    # Without any input the matrix would be singular.
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
        excited=np.divide(gram[..., 0, 0].real ** 2, peaks, out=np.zeros_like(peaks), where=peaks > 0),
    )


def widened(uncertainty: Array, freedom: Array | float) -> Array:
    """Increase a standard uncertainty so that twice it covers 95 % (GUM, G.3: Student's t with `freedom` degrees)."""
    return uncertainty * scipy.special.stdtrit(np.maximum(freedom, 1.0), 0.975) / scipy.special.ndtri(0.975)


def check_resolution(resolution: float, width: float | None) -> tuple[float, float]:
    """Check spacing and width of the bands in Hz; the default width is twice the spacing."""
    step = positive(resolution, "resolution", "Hz")
    return step, 2 * step if width is None else positive(width, "width of a band", "Hz")


def _spectrum(signal: Array, rate: float) -> Complex:
    """FFT of the signal without its mean, scaled so that its mean square is the one-sided power density."""
    return np.asarray(
        scipy.fft.rfft(signal - signal.mean(axis=0), axis=0) * np.sqrt(2 / (rate * len(signal))), np.complex128
    )


def _without(smooth: Array, spectra: Complex) -> Complex:
    """Residual of the spectra, shape (band, point, ...), after projecting out the polynomials."""
    flat = spectra.reshape(*spectra.shape[:2], -1)
    return (flat - smooth @ (smooth.T @ flat)).reshape(spectra.shape)


def channel_delay(frequency: Array, response: Complex, uncertainty: Array) -> tuple[Array, Array]:
    """Fit the delay tau of the line phase = phase_0 - 2 pi f tau by weighted least squares.

    This is the group delay, averaged over the bins; a sensor's resonances contribute through their phase. At least
    three bins in Hz, close enough that the phase changes by less than half a turn between two of them; response and its
    phase uncertainty in rad have the shape (bin, channel). Returns delay and uncertainty in s, shape (channel,); a
    channel without response gets 0 and infinity.
    """
    if len(frequency) < 3:
        raise BandError(f"delay: expected three bins or more, got {len(frequency)}")
    heard = (np.abs(response) > 0).all(axis=0)
    phase = np.unwrap(np.angle(np.where(heard, response, 1)), axis=0)
    # Limit the weights: unknown phases get almost no weight, exact ones a finite weight.
    weight = 1 / np.maximum(np.where(np.isfinite(uncertainty), uncertainty, 1e6), 1e-9) ** 2
    total = weight.sum(axis=0)
    turn = 2 * np.pi * frequency[:, None]
    # Centre on the weighted mean, so that slope and intercept are independent.
    away = turn - (weight * turn).sum(axis=0) / total
    spread = (weight * away**2).sum(axis=0)
    slope = (weight * away * phase).sum(axis=0) / spread
    return np.where(heard, -slope, 0.0), np.where(heard, 1 / np.sqrt(spread), np.inf)


def clock_drift(x: Array, y: Array, rate: float) -> tuple[float, float]:
    """Relative drift of the clock of y (frame, channel) against that of the input x (frame,), and its standard error.

    The delay between the halves of a recording changes by half of its length times the drift. It is the slope of the
    phase of the product of both halves' cross spectra, in bands of eight frequencies. Noise is needed in both halves; a
    sweep has each frequency in one half only, so that nothing is found.
    """
    half = len(x) // 2
    cross: list[Complex] = []
    inputs: list[Array] = []
    for part in (slice(0, half), slice(half, 2 * half)):
        one = _spectrum(x[part, None], rate)
        rows = (
            each[1 : 1 + (half // 2) // 8 * 8].reshape(-1, 8, each.shape[1])
            for each in (_spectrum(y[part], rate) * one.conj(), np.abs(one) ** 2)
        )
        for kept, each in zip((cross, inputs), rows, strict=True):
            kept.append(each.mean(axis=1))
    least, most = np.minimum(*inputs)[:, 0], np.maximum(*inputs)[:, 0]
    excited = least > np.maximum(most / 10, most.max(initial=0.0) / 1000)
    product = (cross[1] * cross[0].conj()).sum(axis=1) * excited
    weight, step = np.abs(product), 8 * rate / half
    if np.count_nonzero(weight) < max(16, len(weight) / 4):
        return 0.0, np.inf
    turn = 2 * np.pi * rate / half * (8 * np.arange(len(product)) + 4.5)
    # The highest peak of the correlation, then a straight line through the phases that are left.
    found = np.abs(np.fft.fft(product / np.maximum(weight, 1e-300), 16 * len(product)))
    peak = np.fft.fftfreq(len(found), step)[found.argmax()]
    left = np.angle(product * np.exp(-1j * turn * peak))
    whole = (weight * turn**2).sum()
    delay = peak + (weight * turn * left).sum() / whole
    error = np.sqrt((weight**2 * turn**2 * (left - turn * (delay - peak)) ** 2).sum()) / whole
    # A later clock has a negative slope.
    return float(-delay * rate / half), float(error * rate / half)


def upper_half(frequency: Array) -> slice:
    """Upper half of the bins, where a delay is most visible and a high-pass filter least; all bins if few."""
    first = int(np.searchsorted(frequency, (frequency[0] + frequency[-1]) / 2))
    return slice(first if len(frequency) - first >= 3 else 0, None)


def quiet_density(recording: Recording, *, resolution: float, width: float) -> tuple[Array, Array, float]:
    """Noise spectrum of a recording without pressure, in the bands of `band_sums`.

    Returns the band frequencies in Hz, the one-sided power density (band, channel) in unit^2/Hz, and the number of
    independent values per band.
    """
    flat = recording.samples.reshape(recording.frames, -1)
    # With an input of zeros, all of the output counts as noise.
    sums = band_sums(np.zeros((len(flat), 1)), flat, recording.rate, resolution=resolution, width=width)
    return sums.frequency, sums.power / sums.points, float(sums.points[0])


def white_level(density: Array, averages: float, overlap: float) -> tuple[Array, Array]:
    """Median amplitude density over the bands, shape (channel,), and its relative standard uncertainty.

    The median of n independent means of m squared values has a relative standard error of sqrt(pi / (2 n m)) in power,
    half of that in amplitude. `averages` is m, and `overlap` the width of a band over the band spacing.
    """
    level = np.sqrt(np.median(density, axis=0))
    independent = max(len(density) / max(overlap, 1.0), 1.0) * max(averages, 1.0)
    return level, np.full(level.shape, 0.5 * np.sqrt(np.pi / (2 * independent)))


def noise_equivalent_pressure(calibration: Calibration, band: Band = BAND) -> Array:
    """Rms pressure in a band that is as strong as each channel's noise, in Pa, shape (row, column).

    It is the root of the integral of ``S_nn / |H|^2`` over the band, or uses the white `noise` if no density was
    measured. It is infinite for a channel whose response is 0 somewhere in the band. Raises BandError if the band (low,
    high) in Hz is not within the calibration's.
    """
    low, high = band
    first, last = calibration.frequency[0], calibration.frequency[-1]
    if not first <= low < high <= last:
        raise BandError(f"band: expected one within {first:g} to {last:g} Hz, got {low:g} to {high:g} Hz")
    frequency = np.linspace(low, high, 512)
    measured = calibration.measurement
    if measured is None:
        density = np.broadcast_to(calibration.noise, (512, *calibration.noise.shape))
    else:
        channels = measured.noise_density.reshape(len(calibration.frequency), -1).T
        density = np.array([np.interp(frequency, calibration.frequency, one) for one in channels]).T
        density = density.reshape(512, *calibration.noise.shape)
    size = np.abs(calibration.response_at(frequency))
    hidden = np.divide(density, size, out=np.full(size.shape, np.inf), where=size > 0)
    return np.sqrt(np.trapezoid(hidden**2, frequency, axis=0))


def known_noise(calibration: Calibration | None, band: Band = BAND) -> Array | None:
    """Noise of each channel in a band as `noise_equivalent_pressure`; None if the calibration does not hold it."""
    if calibration is None or not calibration.noise.any():
        return None
    first, last = calibration.frequency[0], calibration.frequency[-1]
    found = noise_equivalent_pressure(calibration, (max(band[0], first), min(band[1], last)))
    return found if np.isfinite(found).all() else None


def fit_levels(pressure: Array, output: Array, uncertainty: Array) -> Linearity:
    """Fit a line and a parabola to (pressure, output) in Pa of every channel, shape (level, row, column).

    Ordinary least squares. The standard errors come from the scatter about the line or from `uncertainty` (noise of the
    output in Pa), whichever is larger, and are widened by Student's t for the few points.
    """
    if min(len(distinct(column)) for column in pressure.reshape(len(pressure), -1).T) < 5:
        raise InputError(f"levels: expected at least 5 different levels, got {len(distinct(pressure[:, 0, 0]))}")
    line, line_error = _polynomial(pressure, output, uncertainty, 1)
    bend, bend_error = _polynomial(pressure, output, uncertainty, 2)
    gain = np.where(line[1] != 0, line[1], 1)
    # The slope of a x + b x^2 changes by 2 b times the range.
    change = 2 * np.ptp(pressure, axis=0) / gain
    return Linearity(
        pressure=pressure,
        output=output,
        gain=line[1],
        gain_uncertainty=line_error[1],
        intercept=line[0],
        intercept_uncertainty=line_error[0],
        curvature=bend[2] * change,
        curvature_uncertainty=bend_error[2] * np.abs(change),
    )


def predicted_share(part: BandSums, fit: FrequencyResponse, counts: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Share of the predicted output in a recording's output, shape (channel,), and its standard uncertainty.

    s = sum Re(Y_p^* Y) / sum |Y_p|^2 over the valid bands, with Y_p = H X: 1 if the output follows the response. Bands
    overlap by half, so they hold half as much information. A channel without response gets 0 and 1.
    """
    terms = fit.terms[counts]
    along = np.einsum("bci,bci->bc", terms.conj(), part.cross[counts]).real
    power = np.einsum("bci,bcij,bcj->bc", terms.conj(), part.gram[counts], terms).real
    whole = power.sum(axis=0)
    heard = whole > 0
    share = np.divide(along.sum(axis=0), whole, out=np.zeros_like(whole), where=heard)
    error = np.sqrt((fit.noise[counts] * power).sum(axis=0))
    return share, np.divide(error, whole, out=np.ones_like(whole), where=heard)


def bend_uncertainty(share: Array, error: Array) -> Array:
    """Contribution of nonlinearity to the uncertainty of the response, shape (channel,), from `predicted_share`.

    The largest deviation of a level from the common response, minus twice its noise, is the half width of a uniform
    distribution: divided by sqrt(3) (GUM, 4.3.7).
    """
    return np.maximum(np.abs(share - 1) - 2 * error, 0).max(axis=0) / np.sqrt(3)


def same_levels(levels: Array, cell: Sequence[int | None], cells: int) -> NDArray[np.int64] | None:
    """Take numbers of the levels of each channel, weakest first, shape (level, channel); None for fewer than five.

    Takes on all cells are used if they have five levels, otherwise those on each cell alone.
    """
    whole = [index for index, where in enumerate(cell) if where is None]
    chosen = np.tile(np.array(whole, int), (cells, 1)).T
    if len(distinct(levels[whole])) < 5:
        alone = [[index for index, where in enumerate(cell) if where == one] for one in range(cells)]
        if len({len(each) for each in alone}) != 1 or any(len(distinct(levels[each])) < 5 for each in alone):
            return None
        chosen = np.array(alone).T
    return np.take_along_axis(chosen, np.argsort(levels[chosen], axis=0), axis=0)


def distinct(levels: Array, *, apart: float = 0.05) -> Array:
    """Sorted levels that differ from the next lower one by more than the relative distance `apart`."""
    chosen: list[float] = []
    for level in np.sort(levels):
        if not chosen or level > chosen[-1] * (1 + apart):
            chosen.append(float(level))
    return np.array(chosen)


def _polynomial(x: Array, y: Array, noise: Array, degree: int) -> tuple[Array, Array]:
    """Coefficients and standard errors, lowest power first, both of shape (power, row, column)."""
    # Normalise by the highest pressure, so that the normal equations stay well conditioned.
    top = np.maximum(np.abs(x).max(axis=0), 1e-300)
    powers = np.arange(degree + 1)
    design = np.moveaxis(x / top, 0, -1)[..., None] ** powers
    inverse = np.linalg.inv(np.swapaxes(design, -1, -2) @ design)
    pseudo = inverse @ np.swapaxes(design, -1, -2)
    values = np.moveaxis(y, 0, -1)
    found = np.einsum("...pl,...l->...p", pseudo, values)
    rest = values - np.einsum("...lp,...p->...l", design, found)
    free = len(x) - degree - 1
    from_scatter = np.sqrt((rest**2).sum(axis=-1) / free)
    known = np.sqrt((noise**2).mean(axis=0))
    error = np.maximum(widened(from_scatter, free), known)
    unit = np.sqrt(np.diagonal(inverse, axis1=-2, axis2=-1))
    scale = top[..., None] ** powers
    return np.moveaxis(found / scale, -1, 0), np.moveaxis(error[..., None] * unit / scale, -1, 0)
