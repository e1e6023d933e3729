"""Before a comparison: find and remove the delay, and compute what the re-recording of a perfect reproduction is.

An original has passed the soft edges of the band once, during calibration. Its reproduction is recorded and calibrated
again, so it passes them twice: at a corner, where half of the original's amplitude is left, a perfect reproduction has
a quarter. A comparison with the original itself would count this as an error.
"""

from dataclasses import replace
from typing import cast

import numpy as np

from midair.array_types import Array
from midair.dsp import band_edges, band_window, filter_response
from midair.model import PressureFrames
from midair.streaming import LazyFrames, block_ranges, pad_with_silence, read_frames, shift_earlier


def find_delay(original: Array | LazyFrames, later: Array | LazyFrames, rate: float, *, longest: float = 0.05) -> float:
    """Delay of `later` after `original` in s, from the peak of the cross-correlation summed over the channels.

    The peak is located between samples by band-limited interpolation. The delay is 0 if either signal is silent. Both
    signals, shape (frame, ...), have the same channels and `rate` in Hz; `longest` is the largest delay in either
    direction, in s, and at most the length of the signals.
    """
    reach = max(1, min(round(longest * rate), max(len(original), len(later)) - 1))
    around = _correlation(original, later, reach)
    best = int(np.argmax(around))
    # Without positive correlation at any delay, a shift would be arbitrary.
    if around[best] <= 0:
        return 0.0
    if not 0 < best < 2 * reach:
        return (best - reach) / rate
    return (best - reach + _subframe_offset(around, best)) / rate


def _subframe_offset(around: Array, best: int) -> float:
    """Distance from the largest value to the interpolated peak in frames, between -1 and 1.

    A parabola through three values misses the peak of dense noise by up to .07 of a frame. The correlation has no
    components above half the rate, so a sinc with a Hann window interpolates it.
    """
    places = np.arange(max(0, best - _SINC), min(len(around), best + _SINC + 1))
    fine = np.arange(-_FINE, _FINE + 1) / _FINE
    away = best + fine[:, None] - places
    window = np.cos(np.pi / 2 * np.clip(away / (_SINC + 1), -1, 1)) ** 2
    curve = (np.sinc(away) * window) @ around[places]
    peak = int(np.argmax(curve[1:-1])) + 1
    left, middle, right = curve[peak - 1 : peak + 2]
    bend = left - 2 * middle + right
    # Refine only a peak with negative curvature; a flat one has no defined position.
    return float(fine[peak] + (0.5 * (left - right) / bend / _FINE if bend < 0 else 0.0))


_SINC, _FINE = 16, 50
"""Values on each side for the interpolation, and its steps per frame."""


def _correlation(original: Array | LazyFrames, later: Array | LazyFrames, reach: int) -> Array:
    """Cross-correlation for lags of -reach to reach frames, shape (2 reach + 1,), block by block."""
    from scipy.fft import irfft, next_fast_len, rfft

    total = np.zeros(2 * reach + 1)
    for first, last in block_ranges(original.shape):
        a = read_frames(original, first, last).reshape(last - first, -1)
        # Pad with zeros, so that no lag wraps around.
        b = np.zeros((len(a) + 2 * reach, a.shape[1]))
        begin, end = max(0, first - reach), max(0, min(len(later), last + reach))
        if begin < end:
            at = begin - first + reach
            b[at : at + end - begin] = read_frames(later, begin, end).reshape(end - begin, -1)
        length = next_fast_len(len(b), real=True)
        both = np.conj(rfft(a, length, axis=0)) * rfft(b, length, axis=0)
        total += irfft(both.sum(axis=1), length)[: 2 * reach + 1]
    return total


def advance(samples: Array, delay: float, rate: float) -> Array:
    """Shift `samples` earlier by `delay` seconds, with silence on both sides, by a linear phase on the spectrum.

    The delay may have any sign, also fractions of a frame. `samples` have the shape (frame, ...) and a `rate` in Hz;
    lazy frames give lazy frames, see `midair.streaming.lazy_filters.shift_earlier`.
    """
    if isinstance(samples, LazyFrames):
        return cast("Array", shift_earlier(samples, delay * rate))
    length = 2 * len(samples)
    turn = np.exp(2j * np.pi * np.fft.rfftfreq(length, 1 / rate) * delay)
    moved = np.empty((len(samples), int(np.prod(samples.shape[1:], dtype=np.int64))))
    # One channel at a time, because the spectrum of all channels takes four times their memory.
    for channel, values in enumerate(samples.reshape(moved.shape).T):
        moved[:, channel] = np.fft.irfft(np.fft.rfft(values, length) * turn, length)[: len(samples)]
    return moved.reshape(samples.shape)


def apply_band_twice(asked: PressureFrames) -> PressureFrames:
    """Filter a pressure with its own band again, as the re-recording of a perfect reproduction.

    Silence is assumed before and after. A pressure without a band is returned unchanged; lazy frames give lazy frames.
    """
    band = asked.band
    if band is None:
        return asked
    edges = _edges(asked)

    def window(frequency: Array) -> Array:
        return band_window(frequency, band, edges=edges).reshape(-1, 1, 1)

    rest = band_settling_frames(band, asked.rate)
    longer = cast("Array", pad_with_silence(asked.pressure, rest))
    heard = filter_response(longer, asked.rate, window, reach=rest / asked.rate)
    return replace(asked, pressure=heard[rest : rest + asked.frames])


def band_settling_frames(band: tuple[float, float], rate: float) -> int:
    """Number of silent frames after which a band's filter has decayed: four periods of the lower corner."""
    return int(np.ceil(4 * rate / max(band[0], 1.0)))


def _edges(asked: PressureFrames) -> tuple[float, float]:
    """Edges of the band in the calibration step of the provenance, or the default edges."""
    edges = asked.provenance.last("calibrate").get("edges_hz")
    if isinstance(edges, tuple) and len(edges) == 2:
        rise, fall = (float(width) for width in edges if isinstance(width, int | float))
        return rise, fall
    return band_edges(asked.band or (0.0, asked.rate / 2), asked.rate)
