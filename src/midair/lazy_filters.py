"""Filters along the frames of a reel, a segment at a time, with as much around each as the filter reaches.

What comes out is what the same filter in `midair.dsp` makes of the whole in memory: convolutions and other rates to
rounding; responses that are multiplied onto a spectrum to what their answer in time has left beyond the margin.
"""

from collections.abc import Callable
from typing import cast

import numpy as np
from numpy.typing import NDArray

from midair.errors import ShapeError
from midair.lazy_frames import BYTES, LazyFrames, cached_blocks

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


LEAST = 2048
"""Frames around a segment, at least: two seconds of a drive."""


def extend(x: Array, pad: int) -> Array:
    """`x` with `pad` frames on both sides: the end values, held for half of them and then fading to 0."""
    x = np.asarray(x, float)
    if x.ndim < 1 or not len(x):
        raise ShapeError(f"signal: expected at least one frame, got shape {x.shape}")
    ramp = _ramp(pad).reshape(-1, *([1] * (x.ndim - 1)))
    return np.concatenate([ramp * x[:1], x, ramp[::-1] * x[-1:]])


def pad_with_silence(x: Array | LazyFrames, pad: int) -> Array | LazyFrames:
    """`x` with `pad` frames of silence on both sides; of a reel a reel."""
    shape = (len(x) + 2 * pad, *x.shape[1:])
    if not isinstance(x, LazyFrames):
        whole = np.zeros(shape)
        whole[pad : pad + len(x)] = x
        return whole

    def read(first: int, last: int) -> Array:
        part = np.zeros((max(0, last - first), *shape[1:]))
        begin, end = max(0, first - pad), min(len(x), last - pad)
        if begin < end:
            part[begin + pad - first : end + pad - first] = x.read(begin, end)
        return part

    return LazyFrames(read, shape, stored=x.stored)


def pad_with_fade(x: Array | LazyFrames, pad: int, swell: int) -> Array | LazyFrames:
    """`x` with `pad` frames on both sides: silence, and at last `swell` frames of a half cosine to its end values.

    Of a reel a reel.
    """
    swell, quiet = min(swell, pad), pad_with_silence(x, pad)
    if not swell:
        return quiet
    rise = (0.5 - 0.5 * np.cos(np.pi * np.arange(swell) / swell)).reshape(-1, *[1] * (x.ndim - 1))
    before, after = rise * x[0], rise[::-1] * x[len(x) - 1]
    if not isinstance(quiet, LazyFrames):
        quiet[pad - swell : pad], quiet[pad + len(x) : pad + len(x) + swell] = before, after
        return quiet
    whole = quiet

    def read(first: int, last: int) -> Array:
        part = whole.read(first, last)
        for begin, ramp in ((pad - swell, before), (pad + len(x), after)):
            low, high = max(first, begin), min(last, begin + swell)
            if low < high:
                part[low - first : high - first] = ramp[low - begin : high - begin]
        return part

    return LazyFrames(read, whole.shape)


def filter_lazily(
    reel: LazyFrames, rate: float, response: Callable[[Array], Complex | Array], *, reach: float
) -> LazyFrames:
    """As `midair.dsp.filter_response`, of a reel: each segment has its own spectrum.

    Around a segment lie two reaches of the signal on either side, `LEAST` frames at least, of which the outer half
    fades in or out: so a segment ends without a step. What a response answers after that is left out. The inverse of an
    envelope that begins at half the rate with another phase than 0 answers for ever, with 1 / t of a tone at half the
    rate: that is where the two differ.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    pad = int(np.ceil(reach * rate)) + 1
    margin = max(2 * pad, LEAST)
    mean, known = reel.moments.mean, dict[int, Complex | Array]()

    def make(first: int, last: int) -> Array:
        around = _around(reel, first - margin, last + margin, pad, mean, fade=margin // 2)
        length = next_fast_len(len(around), real=True)
        if length not in known:
            # All segments but the last one are equally long.
            known.clear()
            known[length] = _answer(response, np.asarray(np.fft.rfftfreq(length, 1 / rate), np.float64))
        wanted = known[length]
        inside = slice(margin, margin + last - first)
        changing = np.empty((last - first, *reel.shape[1:]))
        # One row of channels after another: spectra of all take several times the memory of the segment.
        for row in range(reel.shape[1]):
            factor = wanted[:, row if wanted.shape[1] > 1 else 0]
            spectrum = rfft(around[:, row], length, axis=0)
            changing[:, row] = irfft(spectrum * factor, length, axis=0, overwrite_x=True)[inside]
        changing += mean * wanted[0].real
        return changing

    return cached_blocks(make, reel.shape, size=max(_usual(reel), 2 * margin), kept=2)


def shift_earlier(reel: LazyFrames, by: float) -> LazyFrames:
    """A reel earlier by so many frames, whole or not, by a linear phase on the spectrum; silence on both sides.

    Beside a segment lie `LEAST` frames more than it is moved by, the outer ones of which fade. So what differs from a
    spectrum of the whole is what lies near half the rate: 1e-6 of what goes up to 48 hundredths of the rate.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    margin, rest = LEAST + int(np.ceil(abs(by))), int(np.prod(reel.shape[1:], dtype=np.int64))

    def make(first: int, last: int) -> Array:
        around = _around(reel, first - margin, last + margin, 0, np.zeros(reel.shape[1:]), fade=LEAST // 2)
        length = next_fast_len(len(around), real=True)
        turn = np.exp(2j * np.pi * np.fft.rfftfreq(length) * by)
        moved = np.empty((last - first, rest))
        for channel, values in enumerate(around.reshape(len(around), rest).T):
            spectrum = rfft(values, length)
            moved[:, channel] = irfft(spectrum * turn, length, overwrite_x=True)[margin : margin + last - first]
        return moved.reshape(-1, *reel.shape[1:])

    return cached_blocks(make, reel.shape, size=max(_usual(reel), 2 * margin), kept=2)


def convolve_lazily(reel: LazyFrames, fir: Array) -> LazyFrames:
    """As `midair.dsp.filter_fir`, of a reel: the same to rounding."""
    from scipy.signal import oaconvolve

    pad = len(fir) - 1

    def make(first: int, last: int) -> Array:
        around = _around(reel, first - pad // 2, last + pad // 2, pad, np.zeros(reel.shape[1:]))
        return np.asarray(oaconvolve(around, fir, mode="valid", axes=0), np.float64)

    return cached_blocks(make, reel.shape, size=max(_usual(reel), 2 * pad), kept=2)


def resample_lazily(reel: LazyFrames, up: int, down: int, fir: Array) -> LazyFrames:
    """As `midair.dsp.resample`, of a reel, by its filter and its fraction: the same to rounding."""
    from scipy.signal import resample_poly

    # Frames of the input that half of the filter covers, and whole periods of the fraction, so that phases agree.
    half = -(-len(fir) // (2 * up)) + 1
    frames = -(-len(reel) * up // down)
    periods = max(1, _usual(reel) // down)

    def make(first: int, last: int) -> Array:
        begin = max(0, (first * down // up - half) // down * down)
        end = min(len(reel), -(-last * down // up) + half + 1)
        # The stubs know windows by name only; the function takes coefficients too.
        y = resample_poly(  # pyright: ignore[reportCallIssue]
            reel.read(begin, end),
            up,
            down,
            window=fir,  # pyright: ignore[reportArgumentType]
            padtype="edge",
        )
        skip = begin // down * up
        return np.asarray(y[first - skip : last - skip], np.float64)

    return cached_blocks(make, (frames, *reel.shape[1:]), size=periods * up, kept=2)


def with_context(reel: LazyFrames, reach: int, function: Callable[[Array], Array]) -> LazyFrames:
    """What `function` makes of frames and `reach` more on either side, held beyond the ends; it gives the inner ones.

    The frames must keep their shape.
    """

    def make(first: int, last: int) -> Array:
        begin, end = max(0, first - reach), min(len(reel), last + reach)
        inside = reel.read(begin, end)
        before, after = reach - (first - begin), reach - (end - last)
        ends = [np.repeat(inside[:1], before, axis=0), np.repeat(inside[-1:], after, axis=0)]
        return function(np.concatenate([ends[0], inside, ends[1]]))

    return cached_blocks(make, reel.shape, size=max(_usual(reel), 2 * reach), kept=2)


def _answer(response: Callable[[Array], Complex | Array], frequency: Array) -> Complex | Array:
    """A response at many frequencies, of some at a time: what working it out takes is several times what it is."""
    step = 4096
    parts = [response(frequency[first : first + step]) for first in range(0, len(frequency), step)]
    return cast("Complex", np.concatenate(parts))


def _usual(reel: LazyFrames) -> int:
    """Frames of about a block."""
    return max(1, BYTES // max(1, 8 * int(np.prod(reel.shape[1:], dtype=np.int64))))


def _around(reel: LazyFrames, first: int, last: int, pad: int, mean: Array, *, fade: int = 0) -> Array:
    """Frames less a mean, from before the beginning to after the end if asked for, extended there as by `extend`.

    Where the signal goes on, the outer `fade` frames fade.
    """
    begin, end = max(0, first), min(len(reel), last)
    whole = np.zeros((last - first, *reel.shape[1:]))
    at = begin - first
    # A block at a time: what is read, and what it is less the mean, would take as much memory as the whole each.
    for block in reel[begin:end].blocks():
        np.subtract(block, mean, out=whole[at : at + len(block)])
        at += len(block)
    ramp, soft = (_ramp(each).reshape(-1, *([1] * (reel.ndim - 1))) for each in (pad, fade))
    if first < 0 and pad:
        count = min(pad, -first)
        whole[-first - count : -first] = ramp[pad - count :] * (reel.moments.first - mean)
    elif fade and first > 0:
        whole[: len(soft)] *= soft
    if last > len(reel) and pad:
        count, behind = min(pad, last - len(reel)), len(reel) - first
        whole[behind : behind + count] = ramp[::-1][:count] * (reel.moments.last - mean)
    elif fade and last < len(reel):
        whole[-len(soft) :] *= soft[::-1]
    return whole


def _ramp(pad: int) -> Array:
    """A half cosine from 0, and then 1: `pad` frames together."""
    fade = pad - pad // 2
    return np.concatenate([0.5 - 0.5 * np.cos(np.pi * np.arange(fade) / max(fade, 1)), np.ones(pad - fade)])
