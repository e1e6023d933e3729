"""How signed pressure is made positive, cell by cell, while it is recorded too.

Radiation pressure is never negative (paper, 4.1). There are four mappings, each a pure function of (frame, ...) in Pa
and the frame rate; the last one is in `midair.targets.receptors`:

- `half_wave`, the paper's: negative values are cut off. ``max(x, 0) = x/2 + |x|/2`` keeps half of the signal and adds
  harmonics.
- `constant_offset`: adds the magnitude of each cell's minimum. Nothing is cut; every cell has pressure all the time.
- `slow_bias`: adds an upper bound of the recent negative values, which changes too slowly to be felt as vibration.
- `receptors`: replaces the waveform by its mean and vibrations of 30 and 150 Hz.

The low-pass effect of frames and transducers is compensated too. Holding a frame and the envelope of a transducer both
act on the amplitude of the sound. `precompensate_sound` inverts them there, at all frequencies: exact if the phase of
the field is constant. `precompensate` inverts them on pressure, within a band: exact for small relative changes of the
pressure. A lead before and after a recording lets it start without a step, and gives a bias time to rise.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from midair.array_types import Array
from midair.dsp import Band, band_window, filter_response
from midair.errors import DeviceStateError, InputError, ShapeError
from midair.model import BAND, AmplitudeFrames, PressureFrames, Setting
from midair.physics import TransducerDynamics, playback_response
from midair.streaming import each_frame
from midair.targets.receptors import RISE, receptors
from midair.validation import one_of, positive


def half_wave(pressure: Array, rate: float = 1.0) -> Array:  # noqa: ARG001, all mappings are called alike
    """The positive part, any shape, in Pa (paper, 4.1)."""
    return np.maximum(pressure, 0.0)


def constant_offset(pressure: Array, rate: float = 1.0, *, offset: Array | float | None = None) -> Array:  # noqa: ARG001
    """Pressure (frame, ...) in Pa plus a constant offset; nothing is cut, so there are no harmonics.

    `offset` is one number or one per cell, in Pa, 0 or more; results below 0 are cut. If None, it is the magnitude of
    each cell's minimum, which needs the whole recording. `rate` is ignored.
    """
    if offset is None:
        return pressure - np.minimum(pressure.min(axis=0), 0.0)
    if not (np.isfinite(offset).all() and np.min(offset) >= 0):
        raise InputError(f"offset: expected 0 Pa or more, got {np.min(offset):g} Pa")
    return np.maximum(pressure + offset, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowBias:
    """P = max(x + b, 0) with b a smooth upper bound of -x within a window.

    b is the sliding maximum of -x, at least 0, smoothed by a Hann window of the same length that is 3 dB down at
    `corner` (its length is .72 / corner: Harris, Proc. IEEE 66(1), 1978), so that nothing is cut.
    """

    corner: float = 8.0
    """Corner frequency of the smoothing in Hz, below the sensor's band, so that the bias is not felt as vibration."""

    def __post_init__(self) -> None:
        positive(self.corner, "corner of the bias", "Hz")

    @classmethod
    def below(cls, band: tuple[float, float]) -> "SlowBias":
        """The bias for a band: its corner is .4 of the lower limit, 8 Hz for 20 Hz.

        Lower limits below 1 Hz count as 1 Hz, since slower changes are no vibration.
        """
        return cls(corner=0.4 * max(band[0], 1.0))

    @property
    def seconds(self) -> float:
        """Time before and after a frame that affects its bias, in s; the delay of a stream."""
        return 0.72 / self.corner

    def reach(self, rate: float) -> int:
        """Frames before and after a frame that affect its bias; the delay of a stream."""
        return 2 * round(0.36 / self.corner * rate)

    def hann(self, rate: float) -> Array:
        """Weights of the smoothing; an odd number, so that the bias is not shifted by half a frame."""
        # Without the two zeros at its ends, which would only add a delay.
        hann = np.hanning(self.reach(rate) + 3)[1:-1]
        return hann / hann.sum()

    def lift(self, surrounded: Array, rate: float) -> Array:
        """The mapping of all frames except the first and last `reach`, shape (frame - 2 reach, ...), in Pa."""
        reach, hann = self.reach(rate), self.hann(rate)
        pulls = np.lib.stride_tricks.sliding_window_view(np.maximum(-surrounded, 0.0), reach + 1, axis=0).max(axis=-1)
        bias = np.apply_along_axis(lambda cell: np.convolve(cell, hann, "valid"), 0, pulls)
        return np.maximum(surrounded[reach : len(surrounded) - reach] + bias, 0.0)

    def __call__(self, pressure: Array, rate: float) -> Array:
        """Map the pressure, same shape, in Pa; beyond its ends the first and last frame are repeated."""
        reach = self.reach(rate)
        ends = [np.repeat(end, reach, axis=0) for end in (pressure[:1], pressure[-1:])]
        return self.lift(np.concatenate([ends[0], pressure, ends[1]]), rate)


class _BiasStream:
    """`SlowBias` frame by frame in 20 us, in memory that is allocated once; the frames before the first are like it."""

    def __init__(self, bias: SlowBias, rate: float, first: Array) -> None:
        self._hann, self._before = bias.hann(rate), bias.reach(rate)
        # Each frame is written twice, so that the last ones are always contiguous.
        flat, pulls = first.reshape(1, -1), np.maximum(-first, 0.0).reshape(1, -1)
        self._frames = np.repeat(flat, 2 * (self._before + 1), axis=0)
        self._pulls, self._tops = (np.repeat(pulls, 2 * (self._before + 1), axis=0) for _ in range(2))
        self._count = 0

    def push(self, frame: Array) -> Array | None:
        """Take the next frame; return the mapped one of `reach` frames ago, None if that is before the first."""
        pulls = np.maximum(-frame.ravel(), 0.0)
        recent = self._kept(self._frames, frame.ravel())
        bias = self._hann @ self._kept(self._tops, self._kept(self._pulls, pulls).max(axis=0))
        self._count += 1
        return np.maximum(recent[0] + bias, 0.0).reshape(frame.shape) if self._count > self._before else None

    def _kept(self, held: Array, row: Array) -> Array:
        """The last rows with a new one, oldest first."""
        length = len(held) // 2
        at = self._count % length
        held[at] = held[at + length] = row
        return held[at + 1 : at + 1 + length]


slow_bias = SlowBias()
"""The slow bias with a corner of 8 Hz, for a band from 20 Hz on."""

MAPPINGS: Mapping[str, Callable[[Array, float], Array]] = MappingProxyType(
    {"half-wave": half_wave, "constant-offset": constant_offset, "slow-bias": slow_bias, "receptors": receptors}
)
"""Mappings by name; each takes (frame, row, column) in Pa and the rate in Hz."""


def mapping_of(name: str, band: tuple[float, float] | None = None) -> Callable[[Array, float], Array]:
    """The mapping of this name for a band in Hz; from 20 Hz on if None.

    Raises InputError if the name is unknown.
    """
    one_of(name, MAPPINGS, "mapping")
    chosen = MAPPINGS[name]
    return SlowBias.below(band) if band is not None and isinstance(chosen, SlowBias) else chosen


class MappingStream:
    """One mapping of a stream of frames; all blocks together equal the mapping of the whole recording, to rounding.

    `push` takes blocks of any length and returns the frames that are ready, `delay` frames late; `finish` returns the
    rest. `mapping` is a name in `MAPPINGS`, and `rate` is in Hz. A constant offset needs `offset` in Pa, shape (row,
    column) or one number, since a stream does not know the later minimum of its cells. `band`, (low, high) in Hz,
    determines a slow bias; from 20 Hz on if None. Raises InputError if the mapping is unknown, or an offset is missing
    for "constant-offset" or given for another.
    """

    def __init__(
        self, mapping: str, rate: float, *, offset: Array | float | None = None, band: tuple[float, float] | None = None
    ) -> None:
        chosen = mapping_of(mapping, band)
        if chosen is receptors:
            raise InputError("mapping: expected one of a single frame for a stream, or slow-bias, got receptors")
        if (mapping == "constant-offset") != (offset is not None):
            raise InputError(
                "offset: expected one in Pa for constant-offset and none for the others, got "
                f"{'none' if offset is None else 'one'} for {mapping}; measure it on an earlier recording"
            )
        self.mapping = mapping
        self._rate, self._offset = positive(rate, "rate", "Hz"), offset
        self._bias = chosen if isinstance(chosen, SlowBias) else None
        self._kept: _BiasStream | None = None
        self._last: Array | None = None

    @property
    def delay(self) -> int:
        """Delay in frames: 0 except for the slow bias, 90 ms for 20 Hz."""
        return 0 if self._bias is None else self._bias.reach(self._rate)

    def push(self, block: Array) -> Array:
        """The frames that are ready after this block, shape (frame, ...), in Pa; possibly none."""
        block = np.asarray(block, float)
        if block.ndim < 1 or not len(block):
            raise ShapeError(f"block: expected at least one frame, got shape {block.shape}")
        self._last = block[-1:]
        if self._bias is not None:
            stream = self._kept = self._kept or _BiasStream(self._bias, self._rate, block[0])
            ready = [frame for frame in map(stream.push, block) if frame is not None]
            return np.stack(ready) if ready else block[:0]
        return half_wave(block) if self._offset is None else constant_offset(block, offset=self._offset)

    def finish(self) -> Array:
        """The remaining frames; the stream can then be used again."""
        if self._last is None:
            raise DeviceStateError("stream: expected at least one push before finish, got none")
        held = np.repeat(self._last, self.delay, axis=0)
        rest = self.push(held) if len(held) else self._last[:0]
        self._kept = self._last = None
        return rest


def precompensate(
    pressure: PressureFrames,
    *,
    dynamics: TransducerDynamics | None = None,
    ramp: float = 0.0,
    band: Band = (20.0, 480.0),
) -> PressureFrames:
    """Pressure filtered by the inverse of the hold of frames and the transducers' envelope.

    W(f) = 1 / [sinc(f / R) sinc(f T) H(f)] within the band and 1 outside, with R the frame rate, T the ramp and H the
    envelope (`physics.playback_response`). Delays are compensated, too. Apply it before a mapping, which handles the
    negative values that it adds.

    The pressure has the frame rate of playback, and the `dynamics` are the default ones if None. `ramp` is the time
    over which a silencer spreads each step, in s; 1 / rate gives linear interpolation. `band` is (low, high) of full
    compensation, in Hz, with cosine transitions from 0 to low and from high to 1.05 high.
    """
    dynamics, (low, high) = dynamics or TransducerDynamics(), band

    def inverse(frequency: np.ndarray) -> np.ndarray:
        inside = band_window(frequency, (low / 2, 1.025 * high), edges=(low, high / 20))
        # The window is .5 at its corners; these corners put the whole band into its flat part.
        response = playback_response(frequency, pressure.rate, dynamics=dynamics, ramp=ramp)
        return (1 + inside * (1 / np.where(inside > 0, response, 1) - 1)).reshape(-1, 1, 1)

    return replace(
        pressure,
        # Four periods of the lower transition, which is `low` wide and has the longest impulse response.
        pressure=filter_response(pressure.pressure, pressure.rate, inverse, reach=4 / low),
        provenance=pressure.provenance.then("precompensate", _settings(dynamics, ramp) | {"band_hz": band}),
    )


def precompensate_sound(
    target: AmplitudeFrames, *, dynamics: TransducerDynamics | None = None, ramp: float = 0.0, reach: float = 0.1
) -> AmplitudeFrames:
    """Sound amplitude filtered by the inverse of the hold of frames and the transducers' envelope.

    1 / [sinc(f / R) sinc(f T) H(f)] up to half the frame rate, which is that of playback. Negative results, where a
    target changes faster than the transducers can follow, are set to 0. `dynamics` and `ramp` are as in
    `precompensate`; `reach` is half the length of the filter's impulse response, in s.
    """
    dynamics = dynamics or TransducerDynamics()

    def inverse(frequency: np.ndarray) -> np.ndarray:
        return 1 / playback_response(frequency, target.rate, dynamics=dynamics, ramp=ramp)[:, None]

    louder = filter_response(target.amplitude, target.rate, inverse, reach=reach)
    return replace(
        target,
        amplitude=each_frame(louder, lambda block: np.maximum(block, 0.0)),
        provenance=target.provenance.then("precompensate sound", _settings(dynamics, ramp)),
    )


def _settings(dynamics: TransducerDynamics, ramp: float) -> dict[str, Setting]:
    return {"ramp_s": ramp, "time_constant_s": dynamics.time_constant, "detuning_rad_s": dynamics.detuning}


LONGEST = 10.0
"""Longest lead, in s."""


def default_lead(mapping: str, band: Band) -> float:
    """Lead in s that a mapping needs in a band: the fade, and before it the rise time of a bias or of levels.

    For 20 Hz 60 ms, 150 ms with a slow bias, and 210 ms for receptors.
    """
    chosen = mapping_of(mapping, band)
    return _swell(band) + (chosen.seconds if isinstance(chosen, SlowBias) else RISE * (chosen is receptors))


def add_lead(pressure: PressureFrames, lead: float) -> PressureFrames:
    """Add `lead` seconds on both sides: silence, then a fade to the first frame.

    Raises InputError if the lead is below 0 or not below 10 s.
    """
    if not 0 <= lead < LONGEST:
        raise InputError(f"lead: expected 0 to {LONGEST:g} s, got {lead:g} s")
    pad = round(lead * pressure.rate)
    if not pad:
        return pressure
    provenance = pressure.provenance.then("lead", {"lead_s": pad / pressure.rate})
    swell = min(pad, round(_swell(pressure.band or BAND) * pressure.rate))
    longer = np.pad(pressure.pressure, ((pad, pad), (0, 0), (0, 0)))
    if swell:
        rise = (0.5 - 0.5 * np.cos(np.pi * np.arange(swell) / swell)).reshape(-1, 1, 1)
        longer[pad - swell : pad] = rise * pressure.pressure[0]
        longer[len(longer) - pad : len(longer) - pad + swell] = rise[::-1] * pressure.pressure[-1]
    return replace(pressure, pressure=longer, provenance=provenance)


def remove_lead(pressure: PressureFrames, frames: int) -> PressureFrames:
    """The middle `frames`, without the lead."""
    first = (pressure.frames - frames) // 2
    return pressure if first <= 0 else replace(pressure, pressure=pressure.pressure[first : first + frames])


def _swell(band: Band) -> float:
    """Length of the fade in s, 1.2 periods of the lower corner: a half wave below half the corner is hardly in the
    band.
    """
    return 1.2 / max(band[0], 1.0)
