"""Exposure profiles: places of ears and hands, and the sound level limit at each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Place of an ear or a hand, and its limit."""

    name: str
    """Such as "left ear"."""
    position: tuple[float, float, float]
    """x, y, z from the centre of the array, in m."""
    reach: float
    """Half the edge of the cube around it that is searched, in m."""
    limit: float
    """Maximum sound pressure level of any frame, in dB."""
    enforced: bool = True
    """True if playing above the limit is refused; False if the level is only reported."""
    source: str = ""
    """Source of the limit, if it differs from the profile's source."""

    @property
    def points(self) -> Array:
        """3 x 3 x 3 points of the cube, shape (27, 3), in m."""
        steps = np.array([-1.0, 0.0, 1.0]) * self.reach
        cube = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        return np.asarray(cube + np.array(self.position), np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureProfile:
    """A named set of limits."""

    name: str
    title: str
    """For whom the limits are."""
    source: str
    """Source of the limits."""
    evidence: str
    """Quality of the evidence."""
    places: tuple[Place, ...]
    """At least one."""
    duty: float = 0.5
    """Highest mean level of a unit over a minute, 0 to 1; midair's own value, since the makers state none."""
    warming: float = 6.0
    """Highest estimated warming of the palm in K: from 35 °C to the 41 °C of IEC 60601-1 for parts on skin."""

    @property
    def nearest(self) -> tuple[int, Place]:
        """Index and place nearest to the array, which is the palm."""
        number = int(np.argmin([np.linalg.norm(place.position) for place in self.places]))
        return number, self.places[number]
