"""Tasks of a sweep, and E of their items with exact and with rounded phases."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from midair.model import AmplitudeFrames, Solution
from midair.physics import focus_amplitude, propagate, quantise_phase, relative_error
from midair.streaming import read_frames


class Task(NamedTuple):
    """Items (patterns or frames) `first` to `last` - 1 of one condition, solved together and stored in `file`."""

    condition: int
    first: int
    last: int

    @property
    def file(self) -> str:
        """Name of the file."""
        return f"{self.condition:04d}-{self.first:06d}.npz"


Job = Callable[[], dict[str, Any]]
"""A task with all its data; it is sent to a worker, called there, and returns `errors_of` the task."""


def errors_of(target: AmplitudeFrames, parts: Iterable[Solution], bits: int) -> dict[str, Any]:
    """E of each frame, also with phases rounded to `bits`, and the target's highest peak over that of one focus."""
    error, rounded, strength, first = [], [], 0.0, 0
    for part in parts:
        drive = replace(part.drive, phase=quantise_phase(part.drive.phase, bits=bits))
        amplitude = read_frames(target.amplitude, first, first + drive.frames)
        field = propagate(drive, target.grid, acoustics=drive.acoustics)
        error.append(part.error)
        # A silent target is played as silence, so its error is 0 for any phases.
        rounded.append(np.where(amplitude.any(axis=1), relative_error(field, amplitude), 0.0))
        peak = float(amplitude.max() / focus_amplitude(target.grid, drive.array, acoustics=drive.acoustics))
        strength, first = max(strength, peak), first + drive.frames
    return {"error": np.concatenate(error), "rounded_error": np.concatenate(rounded), "strength": strength}
