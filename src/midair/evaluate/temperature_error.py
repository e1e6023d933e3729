"""Error of a drive that is played at another temperature than it was solved for."""

from dataclasses import replace

import numpy as np

from midair.array_types import Array
from midair.errors import MismatchError
from midair.model import AmplitudeFrames, Drive, Medium
from midair.physics import propagate, radiation_pressure, relative_error
from midair.streaming import blocks


def error_at_temperature(drive: Drive, target: AmplitudeFrames, medium: Medium, *, frames: int | None = None) -> Array:
    """Compute the error E of a drive at the control points in another medium than its own.

    The target pressure stays the same; the required sound pressure depends on density and speed of sound. The result is
    ``|| |G q| - p || / || p ||`` of each computed frame, empty if all frames are silent.

    `target` is the one that the drive was solved for, `medium` the air in which it is played. Only `frames` evenly
    spaced frames among those that are not silent are computed; all if None. Raises MismatchError if target and drive
    differ in their number of frames.
    """
    if target.frames != drive.frames:
        raise MismatchError(f"target: expected {drive.frames} frames as in the drive, got {target.frames}")
    some = np.flatnonzero(np.concatenate([block.any(axis=1) for block in blocks(target.amplitude)]))
    if frames is not None and len(some) > frames:
        some = some[np.linspace(0, len(some) - 1, frames).round().astype(int)]
    if not len(some):
        return np.zeros(0)
    # Select the frames first: a copy of the whole drive would be as large as its file.
    part = replace(drive, phase=drive.phase[some], level=drive.level[some])
    field = propagate(part, target.grid, acoustics=replace(drive.acoustics, medium=medium))
    here, there = (float(radiation_pressure(np.ones(1), each)[0]) for each in (drive.acoustics.medium, medium))
    return relative_error(field, target.amplitude[some] * np.sqrt(here / there))
