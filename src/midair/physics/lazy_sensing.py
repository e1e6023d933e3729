"""Sensor output for a pressure that does not fit into memory, with intermediate results on disk."""

import numpy as np
from numpy.typing import NDArray

from midair.physics.sensing import SensorModel, cell_pressure, sensor_output
from midair.physics.sensing_by_channel import channel_volts
from midair.streaming import LazyFrames, Stored, TempChannels, TempFrames, each_frame

Array = NDArray[np.float64]


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
