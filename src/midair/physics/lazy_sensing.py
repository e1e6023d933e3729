"""Sensor output for a pressure that does not fit into memory: channel by channel, with intermediate results on disk."""

from collections.abc import Callable

import numpy as np

from midair.array_types import Array, Complex
from midair.physics.sensing import (
    SensorModel,
    cell_pressure,
    channel_response,
    fade_window,
    sensor_output,
    settling_frames,
)
from midair.streaming import LazyFrames, Stored, TempChannels, TempFrames, each_frame


def channel_volts(
    model: SensorModel, number: int, every: Callable[[int], Array], steps: int, rate: float, *, oversample: int
) -> Array:
    """Output of one channel in V before amplifier, noise and converter, as in `sense`, every `oversample`-th step.

    The spectrum below half the output rate is the sum of those of every `oversample`-th step with all offsets
    (decimation in time: Cooley and Tukey, Math. Comp. 19 (1965)), so memory grows with the output, not with the
    pressure. `every` takes the first of `steps` steps, and returns every `oversample`-th pressure on the cell from
    there on, in Pa; `rate` is that of the output, in Hz. The shape is (ceil(steps / oversample),).
    """
    from scipy.fft import irfft, next_fast_len, rfft

    frames, settle = -(-steps // oversample), settling_frames(model, rate)
    length = next_fast_len(frames + 2 * settle, real=True)
    # After the end the last pressure is held and faded out; it belongs to the offset of the last step.
    last, fade = float(every((steps - 1) % oversample)[-1]), fade_window(settle * oversample)
    turn = np.exp(-2j * np.pi * np.arange(length // 2 + 1) / (length * oversample))
    spectrum = np.zeros(length // 2 + 1, np.complex128)
    for phase in reversed(range(oversample)):
        part = np.concatenate([every(phase), last * fade[(phase - steps) % oversample :: oversample]])
        # Horner's scheme in the phase factor of one step.
        spectrum *= turn
        spectrum += rfft(part, length, overwrite_x=True)
    spectrum *= _response(model, number, length, rate) / oversample
    return np.asarray(irfft(spectrum, length, overwrite_x=True)[:frames], np.float64)


def _response(model: SensorModel, number: int, length: int, rate: float) -> Complex:
    """Response of one channel at every bin, shape (bin,)."""
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), np.float64)
    row, column = divmod(number, model.grid.columns)
    parts = [
        channel_response(model, frequency[first : first + _BINS])[:, row, column]
        for first in range(0, len(frequency), _BINS)
    ]
    return np.concatenate(parts)


_BINS = 2**13
"""Bins whose responses are computed at once, for all channels."""


def sense_lazily(
    model: SensorModel,
    pressure: LazyFrames,
    rate: float,
    *,
    rng: np.random.Generator | None = None,
    oversample: int = 1,
) -> LazyFrames:
    """`midair.physics.sense` for pressure in Pa, shape (step, row, column), read once; the result in V is on disk.

    Before quantisation it equals `sense` to rounding.
    """
    steps, frames = len(pressure), -(-len(pressure) // oversample)
    felt = TempChannels(steps, model.grid.count).fill(each_frame(pressure, lambda block: cell_pressure(model, block)))
    volts = TempChannels(frames, model.grid.count)
    for number in range(model.grid.count):

        def every(first: int, number: int = number) -> Array:
            parts = [
                felt.channel(number, begin, min(begin + oversample * _FRAMES, steps))[::oversample]
                for begin in range(first, steps, oversample * _FRAMES)
            ]
            return np.concatenate([*parts, np.zeros(0)])

        volts.put(number, 0, channel_volts(model, number, every, steps, rate, oversample=oversample))
    made = TempFrames(*model.grid.shape)
    # Noise is drawn in frame order, as in `sense`.
    for block in volts.reel(*model.grid.shape).blocks():
        made.append(sensor_output(model, block, rate, rng=rng))
    return LazyFrames(made.read, (frames, *model.grid.shape), stored=storage_precision(model))


_FRAMES = 2**16
"""Frames of one channel that are processed at once."""


def storage_precision(model: SensorModel) -> Stored:
    """Precision that holds every number of a sensor: float32 if 24 binary digits hold the steps of its converter."""
    return "f4" if model.step.as_integer_ratio()[0].bit_length() + model.bits <= 24 else "f8"
