"""A channel as a WAV file that can be played in a browser."""

import base64
import io
import wave
from dataclasses import dataclass

import numpy as np

from midair.array_types import Array
from midair.dsp import resample
from midair.view.view_data import Channels, ViewData

RATE = 48000.0
"""Sampling rate of the sound in Hz; players refuse the rates of sensors."""

_PEAK = 0.9
"""Loudest sample as a share of full scale."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelSound:
    """A channel as sound."""

    data: bytes
    """A WAV file, mono, 16 bits."""
    full_scale: float
    """Full scale in the unit of the channel."""

    @property
    def source(self) -> str:
        """The file as a data URL, for an ``audio`` element."""
        return "data:audio/wav;base64," + base64.b64encode(self.data).decode()


def channel_sound(
    channels: Channels, channel: int, rate: float, *, sound_rate: float = RATE, full_scale: float | None = None
) -> ChannelSound:
    """Convert a channel to sound, without its mean, with 10 ms fades at both ends and its peak near full scale.

    `full_scale`, in the unit of the channel, makes loudness comparable; larger values are clipped. If it is None, the
    loudest sample is at 0.9 of full scale. Raises InputError if there is no such channel.
    """
    channels.check(channel)
    heard = channels.values[:, channel] - channels.values[:, channel].mean()
    heard = _faded(resample(heard, rate, sound_rate), round(10e-3 * sound_rate))
    if full_scale is None:
        full_scale = float(np.abs(heard).max()) / _PEAK or 1.0
    return ChannelSound(data=_wav(np.clip(heard / full_scale, -1, 1), sound_rate), full_scale=full_scale)


def comparison_sounds(showing: ViewData) -> tuple[tuple[str, ChannelSound], ...]:
    """Return label and sound of the selected channel, original and re-recorded, at one scale."""
    both = [each for each in (showing.samples, showing.again) if each is not None]
    alone = [channel_sound(each, showing.channel, showing.rate) for each in both]
    scale = max((each.full_scale for each in alone), default=1.0)
    heard = [channel_sound(each, showing.channel, showing.rate, full_scale=scale) for each in both]
    return tuple((each.label, sound) for each, sound in zip(both, heard, strict=True))


def _faded(x: Array, length: int) -> Array:
    length = min(length, len(x) // 2)
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(length) + 0.5) / max(length, 1))
    window = np.ones(len(x))
    window[:length], window[len(x) - length :] = ramp, ramp[::-1]
    return x * window


def _wav(x: Array, rate: float) -> bytes:
    out = io.BytesIO()
    with wave.open(out, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(round(rate))
        file.writeframes(np.rint(x * 32767).astype("<i2").tobytes())
    return out.getvalue()
