"""The set of airs (temperature, humidity) in which the sound around an ear is computed.

A higher temperature means a longer wavelength, which changes the phases between transducers at a place. Where these
change by at most `STEP` from one air to the next, the loudest of the airs bounds those between them, like the points of
a cube do (docs/decisions/0015-exposure-bound.md).
"""

from dataclasses import replace

import numpy as np

from midair.model import Acoustics, Medium, TransducerArray
from midair.physics.exposure_places import Place
from midair.physics.exposure_search.exposure_grid import middle

UNKNOWN = (14.0, 30.0)
"""Temperature range in degrees Celsius if no temperature is stated; 14 is the paper's 340 m/s."""

AROUND = 2.0
"""Maximum deviation of the room from its stated temperature, in degrees Celsius."""

HUMID = 0.2
"""Maximum deviation of the relative humidity from the stated one, 0 to 1."""

ANY_HUMIDITY = (0.1, 0.9)
"""Range of the relative humidity if none is stated, 0 to 1."""

STEP = 2.6
"""Largest change of phase over the array from one air to the next, in rad."""


def airs_of_room(room: Medium | None, places: tuple[Place, ...], array: TransducerArray) -> tuple[Acoustics, ...]:
    """The airs that a room may have, from the coldest to the warmest.

    They are 2 degrees and 20 % of humidity around the stated air; 14 to 30 degrees if `room` is None. A humidity of 50
    % is that of `Medium.at` by default, and counts as not stated: 10 to 90 %.
    """
    cold, warm = UNKNOWN if room is None else (max(room.degrees - AROUND, 0.0), min(room.degrees + AROUND, 50.0))
    humidity = 0.5 if room is None or room.humidity is None else room.humidity
    dry, damp = ANY_HUMIDITY if humidity == 0.5 else (max(humidity - HUMID, 0.0), min(humidity + HUMID, 1.0))
    # An attenuation that was measured, or computed for another air pressure, counts where it is lower.
    most = np.inf if room is None else room.attenuation
    slow, fast = (Medium.at(temperature=t, humidity=wet).speed for t, wet in ((cold, dry), (warm, damp)))
    turns = 2 * np.pi * array.frequency * (1 / slow - 1 / fast)
    count = 1 + max(2, int(np.ceil(turns * max(_path_difference(place, array) for place in places) / STEP)))
    return tuple(
        Acoustics(medium=_air(float(degrees), float(wet), (dry, damp), most, array.frequency))
        for degrees, wet in zip(np.linspace(cold, warm, count), np.linspace(dry, damp, count), strict=True)
    )


def _air(degrees: float, humidity: float, ends: tuple[float, float], most: float, frequency: float) -> Medium:
    """Air with the lowest attenuation between two humidities, where it has no minimum, and at most `most` Np/m."""
    airs = [Medium.at(temperature=degrees, humidity=each, frequency=frequency) for each in (humidity, *ends)]
    return replace(airs[0], attenuation=min(most, *(air.attenuation for air in airs)))


def _path_difference(place: Place, array: TransducerArray) -> float:
    """Largest difference between the path from a transducer to a place and that from the middle of the array, in m."""
    points = place.points
    path = np.linalg.norm(points[:, None] - array.position, axis=2)
    return float(np.abs(path - np.linalg.norm(points - middle(array), axis=1)[:, None]).max())
