"""A motion stage that draws an object over the sensor: its setup, its strokes and its recorded positions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from midair.errors import InputError
from midair.validation import positive

Place = tuple[float, float, float]
"""x, y, z in machine coordinates, in m; z increases away from the sensor."""

Heading = Literal["+x", "-x", "+y", "-y"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StageStamp:
    """Position and speed of the stage at one time."""

    time: float
    """Time in s: on this computer's monotonic clock during the motion, from the first frame on in a recording."""
    position: Place
    """x, y, z in machine coordinates, in m."""
    feed: float
    """Speed that the machine reports, in m/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StageSetup:
    """How an object is moved to the sensor, along it and back; all positions in machine coordinates."""

    heading: Heading
    """Direction of the strokes."""
    start: tuple[float, float]
    """x, y of the start of a stroke, in m."""
    contact: float
    """z with the object in contact, in m."""
    clear: float
    """z with the object clear of the sensor, in m."""
    approach: float
    """Speed of the descent to contact, in m/s."""
    back: float
    """Speed of all other moves except strokes, in m/s."""
    travel: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    """(least, largest) x, y and z, in m."""
    homing: Literal["switches", "by hand"] = "switches"
    """How the machine finds its reference position."""

    def __post_init__(self) -> None:
        positive(self.approach, "approach", "m/s")
        positive(self.back, "return", "m/s")
        if not self.clear > self.contact:
            raise InputError(
                f"clear_mm: expected a height above contact_mm ({1e3 * self.contact:g} mm), got {1e3 * self.clear:g} mm"
            )
        for axis, (low, high) in zip("xyz", self.travel, strict=True):
            if not low < high:
                raise InputError(
                    f"travel.{axis}_mm: expected the smaller value first, got {1e3 * low:g}, {1e3 * high:g}"
                )

    @property
    def above(self) -> Place:
        """Position above the start of a stroke, out of contact."""
        return (*self.start, self.clear)

    def end(self, stroke: float) -> Place:
        """Position at the end of a stroke of `stroke` metres, in contact."""
        step = stroke if self.heading[0] == "+" else -stroke
        x, y = self.start
        return (x + step, y, self.contact) if self.heading[1] == "x" else (x, y + step, self.contact)

    def check(self, stroke: float) -> None:
        """Raise InputError unless a stroke of `stroke` metres, with approach and return, is within the travel."""
        positive(stroke, "stroke", "m")
        for what, place in (("the start", self.above), ("contact", (*self.start, self.contact))):
            self._within(what, place)
        self._within(f"a stroke of {1e3 * stroke:g} mm", self.end(stroke))

    def _within(self, what: str, place: Place) -> None:
        for axis, at, (low, high) in zip("xyz", place, self.travel, strict=True):
            # A micrometre is less than a step of any stage.
            if not low - 1e-6 <= at <= high + 1e-6:
                raise InputError(
                    f"{what} reaches {axis} {1e3 * at:g} mm: expected {1e3 * low:g} to {1e3 * high:g} mm, the travel "
                    "in the stage's file; nothing has moved"
                )


def speed_of(stamps: Sequence[StageStamp]) -> float | None:
    """Speed over the middle half of a straight path, in m/s; None with fewer than three positions in it.

    The median slope of all pairs of positions (Theil-Sen estimator), which a late time stamp hardly affects.
    """
    places, time = np.array([stamp.position for stamp in stamps]).reshape(-1, 3), [stamp.time for stamp in stamps]
    if not len(places) or not (length := float(np.linalg.norm(places[-1] - places[0]))):
        return None
    way = (places - places[0]) @ (places[-1] - places[0]) / length
    middle = (way >= 0.25 * length) & (way <= 0.75 * length)
    if middle.sum() < 3:
        return None
    return float(scipy.stats.theilslopes(way[middle], np.array(time)[middle]).slope)
