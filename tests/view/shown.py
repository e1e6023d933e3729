import numpy as np

from midair.model import AmplitudeFrames, ControlGrid, Drive, PressureFrames, Provenance, Recording, TransducerArray
from midair.physics import focus_phase
from midair.view import show_drive

ARRAY, GRID = TransducerArray.autd3(), ControlGrid()
FOCUS = GRID.position[9 * 16 + 6]
"""A control point, so that the peak is known: row 9, column 6."""


def recording(frames=60, rate=1000.0, **how):
    """A tone of 100 Hz on channel 6 only."""
    samples = np.zeros((frames, 4, 4))
    samples[:, 1, 2] = np.sin(2 * np.pi * 100 * np.arange(frames) / rate)
    return Recording(samples=samples, rate=rate, provenance=Provenance(source="bench", notes={"object": "tone"}), **how)


def pressure(frames=60, scale=1.0):
    made = recording(frames)
    return PressureFrames(pressure=scale * made.samples, rate=made.rate, provenance=made.provenance)


def focus_drive(frames=8):
    """A focus at FOCUS, silent in the last frame."""
    level = np.ones(frames)
    level[-1] = 0
    phase = np.tile(focus_phase(ARRAY, FOCUS), (frames, 1))
    return Drive(phase=phase, level=level, rate=1000, array=ARRAY)


def focus_target(frames=8):
    amplitude = np.zeros((frames, GRID.count))
    amplitude[:-1, 9 * 16 + 6] = 3000
    return AmplitudeFrames(amplitude=amplitude, rate=1000, grid=GRID)


def focus(frames=8):
    return show_drive(focus_drive(frames), target=focus_target(frames))


def finer_points(grid, times=4):
    """Points of an interpolated field, `times` as many a side, from the first control point to the last, in m."""
    sides = (np.linspace(each[0], each[-1], times * len(each)) for each in (grid.x, grid.y))
    x, y = np.meshgrid(*sides)
    centre = np.array([*grid.centre, grid.height])
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1) + centre
