"""What another temperature than the one that a drive was solved for costs."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.errors import MismatchError
from midair.lazy_frames import blocks
from midair.model import AmplitudeFrames, Drive, Medium
from midair.physics import propagate, radiation_pressure, relative_error

Array = NDArray[np.float64]


def error_at_temperature(drive: Drive, target: AmplitudeFrames, medium: Medium, *, frames: int | None = None) -> Array:
    """E of a drive at the control points when it is played in this air, whatever it was solved for.

    The pressure that is wanted stays; the sound that exerts it differs with density and speed of sound.

    Parameters
    ----------
    drive : Drive
        What is played.
    target : AmplitudeFrames
        What it was solved for.
    medium : Medium
        The air of the room.
    frames : int, optional
        How many frames to look at, evenly spread over those with anything to play; all of them if None.

    Returns
    -------
    ndarray, shape (frame that was looked at,)
        ``|| |G q| - p || / || p ||``; empty if there is nothing to play.

    Raises
    ------
    MismatchError
        If the target has other frames than the drive.
    """
    if target.frames != drive.frames:
        raise MismatchError(f"target: expected {drive.frames} frames as in the drive, got {target.frames}")
    some = np.flatnonzero(np.concatenate([block.any(axis=1) for block in blocks(target.amplitude)]))
    if frames is not None and len(some) > frames:
        some = some[np.linspace(0, len(some) - 1, frames).round().astype(int)]
    if not len(some):
        return np.zeros(0)
    # Only these frames: the drive of all would be as large again as its file.
    part = replace(drive, phase=drive.phase[some], level=drive.level[some])
    field = propagate(part, target.grid, acoustics=replace(drive.acoustics, medium=medium))
    here, there = (float(radiation_pressure(np.ones(1), each)[0]) for each in (drive.acoustics.medium, medium))
    return relative_error(field, target.amplitude[some] * np.sqrt(here / there))
