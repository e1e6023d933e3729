"""What a sensor puts out under a pressure that is too long for the memory: it waits on the disk meanwhile."""

import numpy as np

from midair.physics import SensorModel, channel_volts, felt_by_cells, spoken
from midair.reel import Reel, Stored, each_frame
from midair.spool import Array, Columns, Spool


def sense_reel(
    model: SensorModel, pressure: Reel, rate: float, *, rng: np.random.Generator | None = None, oversample: int = 1
) -> Reel:
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
    felt = Columns(steps, model.grid.count).fill(each_frame(pressure, lambda block: felt_by_cells(model, block)))
    volts = Columns(frames, model.grid.count)
    for number in range(model.grid.count):

        def every(first: int, number: int = number) -> Array:
            parts = [
                felt.channel(number, begin, min(begin + oversample * _FRAMES, steps))[::oversample]
                for begin in range(first, steps, oversample * _FRAMES)
            ]
            return np.concatenate([*parts, np.zeros(0)])

        volts.put(number, 0, channel_volts(model, number, every, steps, rate, oversample=oversample))
    made = Spool(*model.grid.shape)
    # Noise is drawn in the order of the frames, as it is for all of them at once.
    for block in volts.reel(*model.grid.shape).blocks():
        made.append(spoken(model, block, rate, rng=rng))
    return Reel(made.read, (frames, *model.grid.shape), stored=stored_of(model))


_FRAMES = 2**16
"""Of one channel that are looked at together."""


def stored_of(model: SensorModel) -> Stored:
    """Precision that holds every number of a sensor: single where 24 binary digits hold its converter's steps."""
    return "f4" if model.step.as_integer_ratio()[0].bit_length() + model.bits <= 24 else "f8"
