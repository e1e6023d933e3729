"""Where ears and hands are, and what may reach them: the places of an exposure profile."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where somebody's ear or hand is, and what may reach it.

    Attributes
    ----------
    name : str
        Such as "left ear".
    position : tuple of float
        x, y, z from the centre of the array, in m.
    reach : float
        Half the edge of the cube around it that is searched, in m.
    limit : float
        Sound pressure level that no frame may exceed, in dB.
    enforced : bool
        Whether more than the limit is refused, or only told.
    source : str
        Where the limit is from, if not from the profile's source.
    """

    name: str
    position: tuple[float, float, float]
    reach: float
    limit: float
    enforced: bool = True
    source: str = ""

    @property
    def points(self) -> Array:
        """3 x 3 x 3 points of the cube, shape (27, 3), in m."""
        steps = np.array([-1.0, 0.0, 1.0]) * self.reach
        cube = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        return np.asarray(cube + np.array(self.position), np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureProfile:
    """A named set of limits.

    Attributes
    ----------
    name, title : str
        What to call it, and for whom it is.
    source, evidence : str
        Where its limits are from, and how good the evidence is.
    places : tuple of Place
        The places; at least one.
    """

    name: str
    title: str
    source: str
    evidence: str
    places: tuple[Place, ...]

    @property
    def nearest(self) -> tuple[int, Place]:
        """The place that is nearest to the array, the palm, and its number."""
        number = int(np.argmin([np.linalg.norm(place.position) for place in self.places]))
        return number, self.places[number]
