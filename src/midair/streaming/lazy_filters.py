"""Filters for lazy frames, one segment at a time with as much context on both sides as the filter needs.

Results equal those of `midair.dsp` on the whole array: for convolutions and resampling to rounding; for frequency
responses up to the part of their impulse response that lies beyond the margin.
"""

from collections.abc import Callable
from typing import cast

import numpy as np
import scipy

from midair.array_types import Array, Complex
from midair.errors import ShapeError
from midair.streaming.lazy_frames import BYTES, LazyFrames, cached_blocks

LEAST = 2048
"""Minimum number of context frames on either side of a segment: two seconds of a drive."""


def extend(x: Array, pad: int) -> Array:
    """`x` with `pad` frames on both sides: the end values, held for half of them and then fading to 0."""
    x = np.asarray(x, float)
    if x.ndim < 1 or not len(x):
        raise ShapeError(f"signal: expected at least one frame, got shape {x.shape}")
    ramp = _ramp(pad).reshape(-1, *([1] * (x.ndim - 1)))
    return np.concatenate([ramp * x[:1], x, ramp[::-1] * x[-1:]])


def pad_with_silence(x: Array | LazyFrames, pad: int) -> Array | LazyFrames:
    """`x` with `pad` frames of silence on both sides; lazy if `x` is."""
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
    """`x` with `pad` frames on both sides: silence, then `swell` frames of a half cosine to the end values."""
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
    x: LazyFrames, rate: float, response: Callable[[Array], Complex | Array], *, reach: float
) -> LazyFrames:
    """`midair.dsp.filter_response` of lazy frames: each segment has its own spectrum.

    The context on either side is twice the reach and at least `LEAST` frames, of which the outer half fades. The
    impulse response beyond it is cut off, which matters for the inverse of an envelope with a phase other than 0 at
    half the rate: it contains a tone at half the rate that falls as 1 / t.
    """
    pad = int(np.ceil(reach * rate)) + 1
    margin = max(2 * pad, LEAST)
    mean, known = x.moments.mean, dict[int, Complex | Array]()

    def make(first: int, last: int) -> Array:
        around = _with_margins(x, first - margin, last + margin, pad, mean, fade=margin // 2)
        length = scipy.fft.next_fast_len(len(around), real=True)
        if length not in known:
            # All segments except the last one have the same length.
            known.clear()
            frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), np.float64)
            # In parts, because intermediate results are several times as large.
            parts = [response(frequency[begin : begin + 4096]) for begin in range(0, len(frequency), 4096)]
            known[length] = cast("Complex", np.concatenate(parts))
        wanted = known[length]
        inside = slice(margin, margin + last - first)
        changing = np.empty((last - first, *x.shape[1:]))
        # One row of channels at a time: spectra of all rows take several times the memory of the segment.
        for row in range(x.shape[1]):
            factor = wanted[:, row if wanted.shape[1] > 1 else 0]
            spectrum = scipy.fft.rfft(around[:, row], length, axis=0)
            changing[:, row] = scipy.fft.irfft(spectrum * factor, length, axis=0, overwrite_x=True)[inside]
        changing += mean * wanted[0].real
        return changing

    return cached_blocks(make, x.shape, size=max(_block_frames(x), 2 * margin), kept=2)


def shift_earlier(x: LazyFrames, by: float) -> LazyFrames:
    """Shift lazy frames earlier by a number of frames, not necessarily whole, with silence on both sides.

    It multiplies a linear phase. Compared with the spectrum of the whole, the error is 1e-6 up to 0.48 of the rate.
    """
    margin, rest = LEAST + int(np.ceil(abs(by))), int(np.prod(x.shape[1:], dtype=np.int64))

    def make(first: int, last: int) -> Array:
        around = _with_margins(x, first - margin, last + margin, 0, np.zeros(x.shape[1:]), fade=LEAST // 2)
        length = scipy.fft.next_fast_len(len(around), real=True)
        turn = np.exp(2j * np.pi * np.fft.rfftfreq(length) * by)
        moved = np.empty((last - first, rest))
        for channel, values in enumerate(around.reshape(len(around), rest).T):
            spectrum = scipy.fft.rfft(values, length)
            turned = scipy.fft.irfft(spectrum * turn, length, overwrite_x=True)
            moved[:, channel] = turned[margin : margin + last - first]
        return moved.reshape(-1, *x.shape[1:])

    return cached_blocks(make, x.shape, size=max(_block_frames(x), 2 * margin), kept=2)


def convolve_lazily(x: LazyFrames, fir: Array) -> LazyFrames:
    """`midair.dsp.filter_fir` of lazy frames, equal to rounding."""
    pad = len(fir) - 1

    def make(first: int, last: int) -> Array:
        around = _with_margins(x, first - pad // 2, last + pad // 2, pad, np.zeros(x.shape[1:]))
        return np.asarray(scipy.signal.oaconvolve(around, fir, mode="valid", axes=0), np.float64)

    return cached_blocks(make, x.shape, size=max(_block_frames(x), 2 * pad), kept=2)


def resample_poly(x: Array | LazyFrames, up: int, down: int, fir: Array) -> Array | LazyFrames:
    """`x` at `up / down` times its rate, as by `scipy.signal.resample_poly`, whose import takes a third of a second.

    `fir` is a low-pass filter of odd length for `up` times the rate. Beyond its ends, `x` is held; lazy if `x` is.
    """
    taps, frames = -(-len(fir) // up), -(-len(x) * up // down)
    if isinstance(x, LazyFrames):
        # Whole periods of the fraction, so that the phases agree, with input frames for half of the filter.
        half, periods = taps // 2 + 2, max(1, _block_frames(x) // down)

        def make(first: int, last: int) -> Array:
            begin = max(0, (first * down // up - half) // down * down)
            part = x.read(begin, min(len(x), -(-last * down // up) + half))
            skip = begin // down * up
            return np.asarray(resample_poly(part, up, down, fir))[first - skip : last - skip]

        return cached_blocks(make, (frames, *x.shape[1:]), size=periods * up, kept=2)
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


def with_context(x: LazyFrames, reach: int, function: Callable[[Array], Array]) -> LazyFrames:
    """Apply `function` to segments with `reach` frames more per side, held beyond the ends, and keep the inner ones."""

    def make(first: int, last: int) -> Array:
        begin, end = max(0, first - reach), min(len(x), last + reach)
        inside = x.read(begin, end)
        before, after = reach - (first - begin), reach - (end - last)
        ends = [np.repeat(inside[:1], before, axis=0), np.repeat(inside[-1:], after, axis=0)]
        return function(np.concatenate([ends[0], inside, ends[1]]))

    return cached_blocks(make, x.shape, size=max(_block_frames(x), 2 * reach), kept=2)


def _block_frames(x: LazyFrames) -> int:
    return max(1, BYTES // max(1, 8 * int(np.prod(x.shape[1:], dtype=np.int64))))


def _with_margins(x: LazyFrames, first: int, last: int, pad: int, mean: Array, *, fade: int = 0) -> Array:
    """Frames minus a mean, extended as by `extend` beyond the ends; elsewhere the outer `fade` frames fade."""
    begin, end = max(0, first), min(len(x), last)
    whole = np.zeros((last - first, *x.shape[1:]))
    at = begin - first
    # One block at a time: a copy without the mean would double the memory.
    for block in x[begin:end].blocks():
        np.subtract(block, mean, out=whole[at : at + len(block)])
        at += len(block)
    ramp, soft = (_ramp(each).reshape(-1, *([1] * (x.ndim - 1))) for each in (pad, fade))
    if first < 0 and pad:
        count = min(pad, -first)
        whole[-first - count : -first] = ramp[pad - count :] * (x.moments.first - mean)
    elif fade and first > 0:
        whole[: len(soft)] *= soft
    if last > len(x) and pad:
        count, behind = min(pad, last - len(x)), len(x) - first
        whole[behind : behind + count] = ramp[::-1][:count] * (x.moments.last - mean)
    elif fade and last < len(x):
        whole[-len(soft) :] *= soft[::-1]
    return whole


def _ramp(pad: int) -> Array:
    """A half cosine from 0 to 1, then 1: `pad` frames in total."""
    fade = pad - pad // 2
    return np.concatenate([0.5 - 0.5 * np.cos(np.pi * np.arange(fade) / max(fade, 1)), np.ones(pad - fade)])
