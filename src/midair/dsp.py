"""Signal processing along the frame axis: band windows, zero-delay filters, spectra, resampling.

Time is always the first axis; all other axes are kept.
"""

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import cast

import numpy as np

from midair.array_types import Array, Complex
from midair.errors import BandError, ShapeError
from midair.model import BAND
from midair.streaming import BYTES, LazyFrames, cached_blocks
from midair.validation import frozen_array, positive

Band = tuple[float, float]


def check_band(band: Band, rate: float) -> Band:
    """Return `band` as two floats; raise a BandError that suggests another one unless 0 <= low < high <= rate / 2."""
    low, high = frozen_array(band, "band", (2,), finite=False).tolist()
    nyquist = rate / 2
    if not 0 <= low < high <= nyquist:
        fits = BAND if nyquist >= 500 else (0.01 * nyquist, 0.9 * nyquist)
        raise BandError(
            f"band: expected 0 <= low < high <= {nyquist:g} Hz, half the recording's rate of {rate:g} Hz, "
            f"got {low:g} to {high:g} Hz; give one that fits, such as {fits[0]:.2g} to {fits[1]:.3g} Hz"
        )
    return low, high


def band_edges(band: Band, rate: float) -> tuple[float, float]:
    """Default widths of a band window's two edges, in Hz: low / 2 and high / 20, or less where these do not fit."""
    low, high = check_band(band, rate)
    return min(low / 2, high - low), min(high / 20, high - low, rate - 2 * high)


def band_window(frequency: Array, band: Band, *, edges: tuple[float, float]) -> Array:
    """Raised-cosine window B(f): 1 inside the band, 0 outside, 0.5 at its two corners.

    B rises as a half cosine over `edges[0]` around the lower corner and falls over `edges[1]` around the upper one; a
    width of 0 is a step, which includes the corner itself. All frequencies are in Hz. Raises BandError if the edges
    overlap or reach below 0 Hz.
    """
    (low, high), (rise, fall) = band, edges
    if rise < 0 or fall < 0 or rise > 2 * low or low + rise / 2 > high - fall / 2:
        raise BandError(
            f"edges: expected widths that leave a flat part within {low:g} to {high:g} Hz, got {rise:g} and {fall:g} Hz"
        )
    f = np.abs(np.asarray(frequency, float))
    return _ramp(f - low, rise) * _ramp(high - f, fall)


def fft_frequencies(length: int, rate: float) -> Array:
    """Frequencies of a real FFT of `length` frames, from 0 to half the rate, shape (length // 2 + 1,), in Hz."""
    return np.asarray(np.fft.rfftfreq(length, 1 / rate), np.float64)


def fast_length(least: int) -> int:
    """The next product of 2, 3 and 5 alone, for a fast FFT; `scipy.fft` has one, but its import takes .2 s."""
    odd = [3**threes * 5**fives for threes in range(21) for fives in range(15)]
    return min(each << (-(-least // each) - 1).bit_length() for each in odd)


def filter_response(x: Array, rate: float, response: Callable[[Array], Complex | Array], *, reach: float) -> Array:
    """Multiply the spectrum of `x` by a frequency response, without any delay besides that of the response itself.

    Before the first and after the last frame the signal is held, then fades to its mean as a half cosine. A constant is
    therefore filtered exactly, and a signal that starts at rest is assumed to have been at rest before.

    `x` has the shape (frame, ...) and any unit. `response` takes frequencies (bin,) from 0 to half the rate in Hz, and
    returns factors (bin, ...). `reach` is its duration in s, by which the signal is extended on both sides. A target
    that is computed when it is read is also filtered then, block by block; what of the impulse response lies beyond
    twice the reach or `LEAST` frames is cut off.
    """
    pad = int(np.ceil(reach * rate)) + 1
    if isinstance(x, LazyFrames):
        margin, frame = max(2 * pad, LEAST), 8 * int(np.prod(x.shape[1:], dtype=np.int64))

        def make(first: int, last: int) -> Array:
            begin = max(0, first - margin)
            around = x.read(begin, min(last + margin, len(x)))
            return filter_response(around, rate, response, reach=reach)[first - begin : last - begin]

        return cast("Array", cached_blocks(make, x.shape, size=max(BYTES // frame, 2 * margin)))
    x = np.asarray(x, float)
    # Subtracted, so that the extension fades to the mean and not to 0.
    mean = x.mean(axis=0)
    held = extend(x - mean, pad)
    # Padding with a few zeros costs less than a length with a large prime factor.
    length = fast_length(len(held))
    wanted = response(fft_frequencies(length, rate))
    changing = np.fft.irfft(np.fft.rfft(held, length, axis=0) * wanted, length, axis=0)[pad : pad + len(x)]
    return np.asarray(changing + mean * wanted[0].real, np.float64)


LEAST = 2048
"""Least number of frames around a block of lazy frames: half a second of a drive."""


def extend(x: Array, pad: int) -> Array:
    """`x` with `pad` frames on both sides: the end values, held for half of them and then fading to 0 as a cosine."""
    x = np.asarray(x, float)
    if x.ndim < 1 or not len(x):
        raise ShapeError(f"signal: expected at least one frame, got shape {x.shape}")
    fade = pad - pad // 2
    ramp = np.ones((pad, *[1] * (x.ndim - 1)))
    ramp[:fade, ...] = (0.5 - 0.5 * np.cos(np.pi * np.arange(fade) / max(fade, 1))).reshape(-1, *ramp.shape[1:])
    return np.concatenate([ramp * x[:1], x, ramp[::-1] * x[-1:]])


def welch(x: Array, rate: float, *, resolution: float = 4.0) -> tuple[Array, Array]:
    """One-sided power spectral density by Welch's method: Hann segments that overlap by half, mean removed.

    Returns the frequencies (bin,) in Hz and the density (bin, ...) in unit^2/Hz of `x`, shape (frame, ...); its
    integral is the variance. `resolution` is the bin spacing in Hz, coarser where the signal is shorter than 1 / it.
    """
    segment = min(len(x), max(2, round(rate / positive(resolution, "resolution", "Hz"))))
    step = segment - segment // 2
    return fft_frequencies(segment, rate), _density(np.asarray(x), rate, segment, step, (0.5, 0.5))


def _density(x: Array, rate: float, segment: int, step: int, cosines: tuple[float, ...]) -> Array:
    """Power spectral density as by `scipy.signal.welch`, whose import takes a third of a second.

    Segments begin every `step` frames; the factors are those of a cosine-sum window.
    """
    turn = 2 * np.pi * np.arange(segment) / segment
    window = np.sum([(-1) ** k * each * np.cos(k * turn) for k, each in enumerate(cosines)], axis=0)
    parts = np.lib.stride_tricks.sliding_window_view(x, segment, axis=0)[::step]
    power = np.abs(np.fft.rfft((parts - parts.mean(axis=-1, keepdims=True)) * window)) ** 2
    # Negative frequencies are added to the positive ones, except to 0 and half the rate.
    power[..., 1 : (segment + 1) // 2] *= 2
    return np.moveaxis(power.mean(axis=0), -1, 0) / (rate * np.square(window).sum())


def band_energy(x: Array, rate: float, band: Band, *, resolution: float = 2.0) -> Array:
    """`band_energies` in one band, shape (...)."""
    return band_energies(x, rate, [band], resolution=resolution)[0]


def band_energies(x: Array, rate: float, bands: Sequence[Band], *, resolution: float = 2.0) -> Array:
    """Mean square of the part of a signal within each band, both ends included (Hz), in unit^2, shape (band, ...).

    Welch's method with Blackman-Harris segments that overlap by three quarters. Their side lobes are 92 dB down: a
    drift or a strong tone more than four bins away does not leak into the band. Samples in the first or last tenth of a
    segment from either end of the signal have almost no weight. `resolution` is as in `welch`.
    """
    limits = [check_band(band, rate) for band in bands]
    segment = min(len(x), max(2, round(rate / positive(resolution, "resolution", "Hz"))))
    frequency, harris = fft_frequencies(segment, rate), (0.35875, 0.48829, 0.14128, 0.01168)
    density = _density(np.asarray(x), rate, segment, segment - 3 * segment // 4, harris)
    inside = [(frequency >= low) & (frequency <= high) for low, high in limits]
    # Sum times bin spacing: the integral of a density is a mean square.
    return np.array([density[each].sum(axis=0) * rate / segment for each in inside], np.float64)


def strongest_window(power: Array, frames: int) -> int:
    """First of the `frames` frames with the largest sum of `power`, shape (frame,); 0 if it is no longer than that."""
    if len(power) <= frames:
        return 0
    so_far = np.concatenate([[0.0], power.cumsum()])
    return int(np.argmax(so_far[frames:] - so_far[:-frames]))


def resample(x: Array, rate: float, new_rate: float, *, part: slice = slice(None)) -> Array:
    """The same band-limited signal at another rate, or a part of its frames; frame 0 stays at time 0.

    Polyphase filter with a Kaiser window: flat to 0.1 % up to 94 % of half the lower rate (470 of 500 Hz), -6 dB at
    half the lower rate, and 80 dB down from 106 % on. The ratio of the rates is rounded to the nearest fraction with a
    denominator up to 1000. `x`, shape (frame, ...), is held beyond its ends; the result has the shape
    (ceil(frame * new_rate / rate), ...).
    """
    slow, fast = sorted((positive(rate, "rate", "Hz"), positive(new_rate, "new rate", "Hz")))
    ratio = Fraction(fast / slow).limit_denominator(1000)
    up, down = (ratio.numerator, ratio.denominator) if new_rate > rate else (ratio.denominator, ratio.numerator)
    if up == down:
        return np.array(x[part], float)
    slower = max(up, down)
    # Kaiser's beta is 8 for 80 dB of stop-band attenuation; 64 frames of the lower rate per side set the edge width.
    fir = np.kaiser(128 * slower + 1, 8.0) * np.sinc(np.arange(-64 * slower, 64 * slower + 1) / slower)
    fir /= fir.sum()
    first, last, _ = part.indices(-(-len(x) * up // down))
    taps = -(-len(fir) // up)
    begin = max(0, first * down // up - taps) // down * down
    near = np.asarray(x[begin : -(-last * down // up) + taps], float)
    return _resample_poly(near, up, down, fir)[first - begin * up // down :][: last - first]


def _resample_poly(x: Array, up: int, down: int, fir: Array) -> Array:
    """`x` at `up / down` times its rate, as by `scipy.signal.resample_poly`, whose import takes a third of a second.

    `fir` is a low-pass filter of odd length for `up` times the rate. Beyond its ends, `x` is held.
    """
    taps, frames = -(-len(fir) // up), -(-len(x) * up // down)
    # The taps for each place of an output between two frames, those for the last frame first.
    phases = np.pad(up * fir, (0, taps * up - len(fir))).reshape(taps, up)[::-1].T.copy()
    held = np.concatenate([np.repeat(x[:1], taps, axis=0), x, np.repeat(x[-1:], taps, axis=0)])
    windows = np.lib.stride_tricks.sliding_window_view(held.reshape(len(held), -1).T.copy(), taps, axis=1)
    y = np.empty((frames, *x.shape[1:]))
    for first in range(min(up, frames)):
        last, phase = divmod(first * down + len(fir) // 2, up)
        out = y[first::up]
        # Every sum is computed alike, so that a part has the bits of the whole.
        found = np.einsum("ctk,k->tc", windows[:, last + 1 :: down][:, : len(out)], phases[phase])
        out[:] = found.reshape(out.shape)
    return y


def _ramp(x: Array, width: float) -> Array:
    """0 below -width / 2, 1 above +width / 2, a half cosine between."""
    if width == 0:
        return (x >= 0).astype(float)
    return 0.5 + 0.5 * np.sin(np.pi * np.clip(x / width, -0.5, 0.5))
