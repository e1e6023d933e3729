"""Cut, join, resample, trim, scale, fade, mask and mend recordings; each function adds a step to the provenance.

Mending fills short gaps, of values that are NaN or infinite: "line" interpolates linearly and loses any vibration;
"spectrum" minimises the prediction error of an autoregressive model of the neighbourhood, with model and values
estimated in turn (A. Janssen, R. Veldhuis & L. Vries, IEEE Trans. ASSP 34(2), 1986).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from midair import dsp
from midair.array_types import Array
from midair.errors import InputError, MismatchError, NonFiniteError, ShapeError
from midair.model import Event, Provenance, Recording, Setting
from midair.validation import frozen_array, one_of, positive, within

Fill = Literal["zero", "neighbours"]
"""Replacement of a masked channel: 0, or the mean of the cells beside, above and below it."""


def cut(recording: Recording, start: float = 0.0, end: float | None = None) -> Recording:
    """The frames from `start` to `end`, in s (None: the end of the recording); time starts again at 0.

    Both ends are rounded to whole frames and the frame at `end` is not included, so that ``cut(r, 0, t)`` and ``cut(r,
    t)`` share no frame and lose none. Raises InputError if no frame is left, or the part extends beyond the recording
    by more than half a frame.
    """
    stop = recording.duration if end is None else end
    first, last = (round(time * recording.rate) if np.isfinite(time) else -1 for time in (start, stop))
    if not 0 <= first < last <= recording.frames:
        wanted = f"one that begins at {start:g} s" if end is None else f"{start:g} to {end:g} s"
        raise InputError(f"cut: expected a part of 0 to {recording.duration:g} s, got {wanted}")
    return _part(recording, "cut", first, last)


def join(recordings: Sequence[Recording]) -> Recording:
    """Concatenate recordings without a gap or a fade between them.

    Leading steps that all provenances share are kept as steps. The setting ``parts`` of the step "join" holds the rest:
    the source, the number of frames and the own steps of each part. Notes are kept where they agree. Raises InputError
    if the sequence is empty; MismatchError if two recordings differ in sensor, rate or unit.
    """
    if not recordings:
        raise InputError("join: expected at least one recording, got none")
    first = recordings[0]
    for number, other in enumerate(recordings[1:], start=2):
        for name in ("sensor", "rate", "unit"):
            have, want = getattr(other, name), getattr(first, name)
            if have != want:
                advice = "; resample it first" if name == "rate" else ""
                raise MismatchError(
                    f"join: expected {name} {want} as in the first, got {have} in number {number}{advice}"
                )
    samples = np.concatenate([recording.samples for recording in recordings])
    return replace(first, samples=samples, provenance=_joined(recordings))


def resample(recording: Recording, rate: float) -> Recording:
    """The same band-limited signal at another rate in Hz (`midair.dsp.resample`); frame 0 stays at time 0.

    Flat to 0.1 % up to 94 % of half the lower rate. The ratio of the rates is rounded to the nearest fraction with a
    denominator up to 1000; where that error exceeds 1e-6, the result has the rate of the fraction. Raises InputError if
    the rate is not above 0.
    """
    from fractions import Fraction

    rate = positive(rate, "rate", "Hz")
    slow, fast = sorted((recording.rate, rate))
    # The same fraction as `dsp.resample` takes.
    ratio = Fraction(fast / slow).limit_denominator(1000)
    exact = recording.rate * float(ratio) if rate > recording.rate else recording.rate / float(ratio)
    exact = rate if abs(exact / rate - 1) < 1e-6 else exact
    settings: dict[str, Setting] = {"from_hz": recording.rate, "to_hz": exact}
    samples = dsp.resample(recording.samples, recording.rate, rate)
    return replace(recording, samples=samples, rate=exact, provenance=recording.provenance.then("resample", settings))


def trim(recording: Recording, *, share: float = 0.05, level: float | None = None, margin: float = 0.05) -> Recording:
    """Remove the silence at both ends but for `margin` seconds; silence in between stays.

    A frame is silent if no channel is further from its median than `level`, in the unit of the samples, or else than
    the part `share`, 0 to 1, of the largest such distance. Raises InputError if the whole recording is silent, or a
    setting is out of range.
    """
    if not 0 <= share < 1:
        raise InputError(f"trim: expected a share of 0 to below 1, got {share:g}")
    within(margin, "trim: margin", 0, unit="s")
    # The median estimates the output at rest, which need not be 0; the touch would shift a mean.
    away = np.abs(recording.samples - np.median(recording.samples, axis=0)).max(axis=(1, 2))
    most = float(away.max())
    limit = share * most if level is None else float(level)
    loud = np.flatnonzero(away > limit)
    if not len(loud):
        raise InputError(
            f"trim: expected something above {limit:g} {recording.unit}, got at most {most:g}; lower the level"
        )
    spare = round(margin * recording.rate)
    first, last = max(0, int(loud[0]) - spare), min(recording.frames, int(loud[-1]) + 1 + spare)
    return _part(recording, "trim", first, last, level=limit, margin_s=float(margin))


def gain(recording: Recording, factor: ArrayLike) -> Recording:
    """Multiply the samples by one factor, or by a factor for each channel, shape (row, column).

    The sensor's calibration does not change: calibrated pressure grows by the same factor. Raises ShapeError or
    NonFiniteError if the factors do not match the sensor, or one is not finite.
    """
    shape = np.shape(factor)
    if shape not in ((), recording.sensor.shape):
        raise ShapeError(f"gain: expected one factor or {recording.sensor.shape}, got shape {shape}")
    factors = frozen_array(factor, "gain", shape)
    setting: Setting = tuple(map(tuple, factors.tolist())) if shape else float(factors)
    return replace(
        recording,
        samples=recording.samples * factors,
        provenance=recording.provenance.then("gain", {"factor": setting}),
    )


def select(recording: Recording, channels: Sequence[int]) -> Recording:
    """Some channels, numbered row by row from 0, in this order and as one row of cells of the same pitch.

    Raises ShapeError if a channel does not exist, or none is named.
    """
    chosen = list(channels)
    for channel in chosen:
        recording.sensor.channel_position(channel)
    samples = recording.samples.reshape(recording.frames, 1, -1)[..., chosen]
    settings: dict[str, Setting] = {"channels": tuple(chosen)}
    sensor = replace(recording.sensor, rows=1, columns=len(chosen))
    return replace(recording, samples=samples, sensor=sensor, provenance=recording.provenance.then("select", settings))


def fade(recording: Recording, start: float = 0.05, end: float = 0.05) -> Recording:
    """Fade in from and out to the median of each channel, over `start` and `end` seconds, along half a cosine.

    Raises InputError if a fade is negative, or both are longer than the recording.
    """
    first, last = (round(time * recording.rate) if np.isfinite(time) else -1 for time in (start, end))
    if min(first, last) < 0 or first + last > recording.frames:
        raise InputError(
            f"fade: expected two times of 0 s or more within {recording.duration:g} s, got {start:g} and {end:g} s"
        )
    rest, frames = np.median(recording.samples, axis=0), recording.frames

    def faded(begin: int, count: int, way: int) -> Array:
        ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(count) + 0.5) / max(count, 1))[::way, None, None]
        return rest + ramp * (recording.samples[begin : begin + count] - rest)

    parts = [faded(0, first, 1), recording.samples[first : frames - last], faded(frames - last, last, -1)]
    provenance = recording.provenance.then("fade", {"start_s": float(start), "end_s": float(end)})
    return replace(recording, samples=np.concatenate(parts), provenance=provenance)


def mask(recording: Recording, channels: Iterable[int], *, fill: Fill = "zero") -> Recording:
    """Replace channels by 0, or by the mean of their neighbours that are not masked.

    Channels are numbered row by row from 0. Raises ShapeError if a channel does not exist, and InputError if `fill` is
    unknown or a masked channel has no neighbour left.
    """
    one_of(fill, Fill, "fill")
    masked = sorted(set(channels))
    for channel in masked:
        recording.sensor.channel_position(channel)
    beside = {channel: _neighbours(recording, channel, masked) for channel in masked} if fill == "neighbours" else {}

    samples = recording.samples.reshape(recording.frames, -1).copy()
    samples[:, masked] = 0
    for channel, others in beside.items():
        samples[:, channel] = samples[:, others].mean(axis=1)
    settings: dict[str, Setting] = {"channels": tuple(masked), "fill": fill}
    provenance = recording.provenance.then("mask", settings)
    return replace(recording, samples=samples.reshape(recording.samples.shape), provenance=provenance)


def _part(recording: Recording, stage: str, first: int, last: int, **settings: Setting) -> Recording:
    span: dict[str, Setting] = {"start_s": first / recording.rate, "end_s": last / recording.rate}
    provenance = recording.provenance.then(stage, {**span, **settings})
    return replace(recording, samples=recording.samples[first:last], provenance=provenance)


def _neighbours(recording: Recording, channel: int, masked: list[int]) -> list[int]:
    rows, columns = recording.sensor.shape
    row, column = divmod(channel, columns)
    around = ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1))
    found = [r * columns + c for r, c in around if 0 <= r < rows and 0 <= c < columns]
    left = [other for other in found if other not in masked]
    if not left:
        raise InputError(
            f'mask: expected a neighbour of channel {channel} that is not masked, got none; use fill="zero"'
        )
    return left


def _joined(recordings: Sequence[Recording]) -> Provenance:
    lives = [recording.provenance for recording in recordings]
    first = lives[0]
    shared = 0
    same_source = all(life.source == first.source for life in lives)
    while same_source and all(len(life.steps) > shared and life.steps[shared] == first.steps[shared] for life in lives):
        shared += 1
    sources = list(dict.fromkeys(life.source for life in lives))
    parts = tuple(
        (life.source, recording.frames, tuple((one.stage, tuple(one.settings.items())) for one in life.steps[shared:]))
        for life, recording in zip(lives, recordings, strict=True)
    )
    notes = {name: text for name, text in first.notes.items() if all(life.notes.get(name) == text for life in lives)}
    joined = Provenance(
        source=" + ".join(sources),
        simulated=any(life.simulated for life in lives),
        notes=notes,
        steps=first.steps[:shared],
    )
    return joined.then("join", {"parts": parts})


GapFill = Literal["spectrum", "line"]
"""Autoregressive interpolation, or a straight line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mending:
    """Settings for filling gaps."""

    longest: float = 20e-3
    """Longest gap that may be filled, in s; longer ones raise an error."""
    fill: GapFill = "spectrum"

    def __post_init__(self) -> None:
        positive(self.longest, "longest gap", "s")
        one_of(self.fill, GapFill, "mend")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mended:
    """Samples without gaps, and the positions of the gaps that were filled."""

    samples: Array
    """Finite, shape (frame, channel)."""
    journal: tuple[Event, ...]
    """One event of kind "mended" for each gap of each channel, sorted by frame."""


def mend(samples: Array, rate: float, mending: Mending) -> Mended:
    """Fill the gaps (NaN or infinite) of all channels in `samples` (frame, channel); all other values stay equal.

    A gap at either end of the recording takes the nearest value; `rate` is in Hz. Raises NonFiniteError if a gap is
    longer than `mending` allows.
    """
    filled = np.array(samples, np.float64)
    journal: list[Event] = []
    for channel, wave in enumerate(filled.T):
        gaps = _gaps(wave)
        for first, last in gaps:
            _check(channel, first, last - first, rate, mending)
            journal.append(Event(kind="mended", frame=first, frames=last - first, channel=channel))
        _fill(wave, gaps, mending.fill)
    return Mended(samples=filled, journal=tuple(sorted(journal, key=lambda event: (event.frame, event.channel))))


def _gaps(wave: Array) -> list[tuple[int, int]]:
    """First frame of each gap, and the first frame after it."""
    missing = np.concatenate([[False], ~np.isfinite(wave), [False]])
    return [(int(first), int(last)) for first, last in np.flatnonzero(missing[1:] != missing[:-1]).reshape(-1, 2)]


def _check(channel: int, first: int, frames: int, rate: float, mending: Mending) -> None:
    # Half a frame of tolerance, so that rounding does not matter: 20 ms at 1 kHz are 20 frames.
    if frames > mending.longest * rate + 0.5:
        raise NonFiniteError(
            f"mend: expected gaps of {mending.longest * 1e3:g} ms at most, got {frames} frames "
            f"({frames / rate * 1e3:.4g} ms) from {first / rate:.4g} s on in channel {channel}; give --mend a longer "
            "time, or leave that channel out (--channels)"
        )


def _fill(wave: Array, gaps: list[tuple[int, int]], fill: GapFill) -> None:
    if not gaps:
        return
    missing = ~np.isfinite(wave)
    known = np.flatnonzero(~missing)
    wave[missing] = np.interp(np.flatnonzero(missing), known, wave[known])
    if fill == "line":
        return
    for first, last in gaps:
        if first > 0 and last < len(wave):
            _predict(wave, missing, first, last)


def _predict(wave: Array, missing: NDArray[np.bool_], first: int, last: int) -> None:
    """Fill one gap in place by autoregressive interpolation; other gaps near it stay linear."""
    # Janssen's rule for the order, and a neighbourhood of up to ten orders on either side.
    order = min(3 * (last - first) + 2, 64)
    begin, end = max(0, first - 10 * order), min(len(wave), last + 10 * order)
    if int((~missing[begin:end]).sum()) < 4 * order:
        return
    around = wave[begin:end]
    mean = float(around[~missing[begin:end]].mean())
    x = around - mean
    gap = np.arange(first - begin, last - begin)
    inside = slice(first - begin, last - begin)
    for _ in range(5):
        errors = _prediction_errors(x, order)
        rest = np.delete(errors, gap, axis=1) @ np.delete(x, gap)
        # A small ridge, so that a silent neighbourhood is solvable.
        gram = errors[:, inside].T @ errors[:, inside] + 1e-12 * np.eye(last - first)
        x[inside] = np.linalg.solve(gram, -errors[:, inside].T @ rest)
    wave[first:last] = x[inside] + mean


def _prediction_errors(x: Array, order: int) -> Array:
    """Matrix of the errors of predicting each value of `x` from the `order` values before it."""
    n = len(x)
    correlation = np.correlate(x, x, "full")[n - 1 : n + order] / n
    # 1e-7 of white noise, because pure tones leave the model undetermined.
    correlation[0] = correlation[0] * (1 + 1e-7) + np.finfo(float).tiny
    model = np.concatenate([[1.0], -scipy.linalg.solve_toeplitz(correlation[:order], correlation[1:])])
    return np.asarray(scipy.linalg.convolution_matrix(model, n, mode="valid"), np.float64)
