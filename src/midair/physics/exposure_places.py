"""Exposure profiles: places of ears and hands, the sound level limit at each, and the points searched around it."""

from dataclasses import dataclass, replace

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model import Acoustics, TransducerArray
from midair.physics.propagation import wavenumber

MOST_PROTECTION = 40.0
"""Largest attenuation of ear protection that can be stated, in dB."""


def combined(*axes: Array) -> Array:
    """All combinations of coordinates, shape (point, axis), the last coordinate changing fastest."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes)).astype(np.float64)


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
        return combined(steps, steps, steps) + np.array(self.position)


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
    hours: float = 24.0
    """Longest exposure of a person a day for which the source states the limits, in hours."""

    def under(self, limit: float) -> "ExposureProfile":
        """The profile with the same limit in dB at all enforced places."""
        places = tuple(replace(place, limit=limit) if place.enforced else place for place in self.places)
        return replace(self, name=f"{limit:g} dB", title=f"{limit:g} dB at the ears", places=places)

    def behind(self, attenuation: float) -> "ExposureProfile":
        """The profile for people whose ear protection attenuates by this many dB at 40 kHz, as stated by the user.

        0 dB returns the profile itself. Raises InputError outside of 0 to 40 dB, a value of midair against slips.
        """
        if not 0 <= attenuation <= MOST_PROTECTION:
            raise InputError(
                f"ear protection: expected 0 to {MOST_PROTECTION:g} dB at 40 kHz, got {attenuation:g} dB; use the "
                "figure of a measurement at 40 kHz, not the rating for audible noise"
            )
        if not attenuation:
            return self
        name = f"{self.name}, {attenuation:g} dB of ear protection stated by the user"
        places = tuple(
            replace(place, limit=place.limit + attenuation) if place.enforced else place for place in self.places
        )
        return replace(self, name=name, places=places)

    @property
    def nearest(self) -> tuple[int, Place]:
        """Index and place nearest to the array, which is the palm."""
        number = int(np.argmin([np.linalg.norm(place.position) for place in self.places]))
        return number, self.places[number]


def cone_points(place: Place, array: TransducerArray, acoustics: Acoustics, *, step: float) -> Array:
    """Points of a place's cube with the spacing at which the sound can change, shape (point, 3), in m.

    Across the cone they form a checkerboard, along it prisms. Points outside the cube are moved to its surface. `step`
    is the largest change, from a point to the next, of the phase between two waves from the edges of the cone, in rad.
    """
    away = place.points[:, None, :] - array.position[None, :, :]
    axes, half = _cone((away / np.linalg.norm(away, axis=2, keepdims=True)).reshape(-1, 3))
    reach = place.reach
    # The cone of one transducer is a line: limit the spacing to the width of the cube.
    apart = np.minimum(step / np.maximum(wavenumber(array, acoustics.medium) * half, 1e-9), 2 * reach)
    count = np.ceil(reach * np.abs(axes).sum(axis=1) / apart).astype(int) + 1
    i, j, k = combined(*[np.arange(-n, n + 1) for n in count]).T
    white = (i + j) % 2 == 0
    steps = np.stack([i, j, k + 0.5 * (i % 2)], axis=1)[white]
    free = steps * apart @ axes
    kept = np.clip(free, -reach, reach)
    moved = np.abs((kept - free) @ axes.T) / apart
    # Points moved by more than one and a half prisms represent nothing inside.
    kept = kept[(moved[:, 0] + moved[:, 1] <= 1.5) & (moved[:, 2] <= 0.8)]
    return np.unique(np.round(kept, 4), axis=0) + np.array(place.position)


def _cone(directions: Array) -> tuple[Array, Array]:
    """Axes of the cone of these directions, one per row, the last one along it; and its half width along each."""
    along = directions.mean(axis=0)
    along /= np.linalg.norm(along)
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.linalg.norm(aside)
    across = np.cross(along, aside)
    # Rotate to the smallest width: a square array would seem twice as large along its diagonal.
    turned = [
        np.stack([np.cos(turn) * aside + np.sin(turn) * across, np.cos(turn) * across - np.sin(turn) * aside, along])
        for turn in np.radians(np.arange(0, 90, 7.5))
    ]
    widths = [np.ptp(directions @ axes.T, axis=0) / 2 for axes in turned]
    best = int(np.argmin([width[0] * width[1] for width in widths]))
    return turned[best], widths[best]
