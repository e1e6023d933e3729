"""What a sensor puts out under a pressure that is too long for the memory: it waits on the disk meanwhile."""

import numpy as np

from midair.lazy_frames import LazyFrames, Stored, each_frame
from midair.physics import SensorModel, cell_pressure, channel_volts, sensor_output
from midair.temp_frames import Array, TempChannels, TempFrames


def sense_lazily(
    model: SensorModel,
    pressure: LazyFrames,
    rate: float,
    *,
    rng: np.random.Generator | None = None,
    oversample: int = 1,
) -> LazyFrames:
    """As `midair.physics.sense`, of a reel: the same to the rounding of sums, and that before the converter's steps.

    Parameters
    ----------
    model, rate, rng, oversample
        As there.
    pressure : Reel, shape (step, row, column)
        On the cells, in Pa; it is read once.

    Returns
    -------
    Reel, shape (ceil(step / oversample), row, column)
        In V; it lies on the disk.
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
    # Noise is drawn in the order of the frames, as it is for all of them at once.
    for block in volts.reel(*model.grid.shape).blocks():
        made.append(sensor_output(model, block, rate, rng=rng))
    return LazyFrames(made.read, (frames, *model.grid.shape), stored=storage_precision(model))


_FRAMES = 2**16
"""Of one channel that are looked at together."""


def storage_precision(model: SensorModel) -> Stored:
    """Precision that holds every number of a sensor: single where 24 binary digits hold its converter's steps."""
    return "f4" if model.step.as_integer_ratio()[0].bit_length() + model.bits <= 24 else "f8"
