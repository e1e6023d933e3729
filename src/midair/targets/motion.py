"""A slow circular motion of the pattern, to be felt as pressure below 20 Hz, which the sensor does not measure.

Steady radiation pressure is hardly felt; a focus that circles a few millimetres at 5 Hz is felt as steady pressure
(Morisaki et al., 2022 and 2023, on single foci). Here the whole pattern is moved. This has not been validated on
people.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.validation import positive

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """Motion of the pattern on a circle around its place. Not validated on people."""

    radius: float = 3e-3
    """In m."""
    frequency: float = 5.0
    """In Hz, below 20; at higher frequencies it is felt as vibration."""

    def __post_init__(self) -> None:
        positive(self.radius, "radius of the circle", "m")
        if positive(self.frequency, "frequency of the circle", "Hz") >= 20:
            raise InputError(f"frequency of the circle: expected below 20 Hz, got {self.frequency:g} Hz")

    def offset(self, time: Array) -> Array:
        """Displacement (x, y) of the pattern, shape (frame, 2), in m; at time 0 along x."""
        turn = 2 * np.pi * self.frequency * time
        return self.radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)

    def __str__(self) -> str:
        return f"circle of {1e3 * self.radius:g} mm at {self.frequency:g} Hz, not validated on people"
