"""A filter for lazy frames, one segment at a time with as much context on both sides as it needs.

Results equal those of `midair.dsp.filter_response` on the whole array up to the part of the impulse response that lies
beyond the margin.
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
    mean = np.asarray(sum(block.sum(axis=0) for block in x.blocks()) / len(x), np.float64)
    ends, known = (x[0], x[len(x) - 1]), dict[int, Complex | Array]()

    def make(first: int, last: int) -> Array:
        around = _with_margins(x, first - margin, last + margin, pad, mean, ends, fade=margin // 2)
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


def _block_frames(x: LazyFrames) -> int:
    return max(1, BYTES // max(1, 8 * int(np.prod(x.shape[1:], dtype=np.int64))))


def _with_margins(
    x: LazyFrames, first: int, last: int, pad: int, mean: Array, ends: tuple[Array, Array], *, fade: int
) -> Array:
    """Frames minus a mean, extended as by `extend` beyond the ends; elsewhere the outer `fade` frames fade.

    `ends` are the first and the last frame.
    """
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
        whole[-first - count : -first] = ramp[pad - count :] * (ends[0] - mean)
    elif fade and first > 0:
        whole[: len(soft)] *= soft
    if last > len(x) and pad:
        count, behind = min(pad, last - len(x)), len(x) - first
        whole[behind : behind + count] = ramp[::-1][:count] * (ends[1] - mean)
    elif fade and last < len(x):
        whole[-len(soft) :] *= soft[::-1]
    return whole


def _ramp(pad: int) -> Array:
    """A half cosine from 0 to 1, then 1: `pad` frames in total."""
    fade = pad - pad // 2
    return np.concatenate([0.5 - 0.5 * np.cos(np.pi * np.arange(fade) / max(fade, 1)), np.ones(pad - fade)])
