"""A stage that draws an object over the sensor: where it may go, what a stroke is, and where it was when."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.validation import positive

Place = tuple[float, float, float]
"""x, y, z in the machine's coordinates, in m; z grows away from the sensor."""

Heading = Literal["+x", "-x", "+y", "-y"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StageStamp:
    """Where the stage was, and how fast it went.

    Attributes
    ----------
    time : float
        In s: by this computer's steady clock while it moves, from the first frame on in a recording.
    position : tuple of float
        x, y, z in the machine's coordinates, in m.
    feed : float
        Speed as the machine says it, in m/s.
    """

    time: float
    position: Place
    feed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StageSetup:
    """How an object is brought to the sensor, drawn over it, and taken back; all places in the machine's coordinates.

    Attributes
    ----------
    heading : {"+x", "-x", "+y", "-y"}
        Where strokes go.
    start : tuple of float
        x, y of where they begin, in m.
    contact, clear : float
        z at which the object touches as it should, and z at which it touches nothing, in m.
    approach, back : float
        Speed down to the contact, and of all that is no stroke, in m/s.
    travel : tuple of three pairs of float
        Least and largest x, y and z, in m.
    homing : {"switches", "by hand"}
        How the machine comes to know where it is.
    """

    heading: Heading
    start: tuple[float, float]
    contact: float
    clear: float
    approach: float
    back: float
    travel: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    homing: Literal["switches", "by hand"] = "switches"

    def __post_init__(self) -> None:
        positive(self.approach, "approach", "m/s")
        positive(self.back, "return", "m/s")
        if not self.clear > self.contact:
            raise InputError(
                f"clear_mm: expected a height above contact_mm ({1e3 * self.contact:g} mm), got {1e3 * self.clear:g} mm"
            )
        for axis, (low, high) in zip("xyz", self.travel, strict=True):
            if not low < high:
                raise InputError(f"travel.{axis}_mm: expected the smaller first, got {1e3 * low:g}, {1e3 * high:g}")

    @property
    def above(self) -> Place:
        """Over the beginning of a stroke, touching nothing."""
        return (*self.start, self.clear)

    def end(self, stroke: float) -> Place:
        """Where a stroke of so many metres ends, in contact."""
        step = stroke if self.heading[0] == "+" else -stroke
        x, y = self.start
        return (x + step, y, self.contact) if self.heading[1] == "x" else (x, y + step, self.contact)

    def check(self, stroke: float) -> None:
        """Raise unless a whole stroke, with its way there and back, is within the travel.

        Raises
        ------
        InputError
            If any place of it lies beyond.
        """
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


def check_reached(speed: float, way: float, *, largest: float, growth: float) -> None:
    """Raise unless a machine reaches a speed and keeps it over at least half of a way.

    Parameters
    ----------
    speed, largest : float
        That is asked for, and the largest one of the machine along that way, in m/s.
    way : float
        In m.
    growth : float
        Acceleration of the machine, in m/s2; speeding up and slowing down take speed**2 / growth together.

    Raises
    ------
    InputError
        If it does not.
    """
    if speed > largest:
        raise InputError(
            f"--speed: expected up to {1e3 * largest:g} mm/s, the machine's own limit along the stroke, got "
            f"{1e3 * speed:g} mm/s; it would go slower without a word"
        )
    if speed**2 / growth > way / 2:
        raise InputError(
            f"--speed: {1e3 * speed:g} mm/s is reached over less than half of {1e3 * way:g} mm: speeding up at "
            f"{1e3 * growth:g} mm/s2 and slowing down take {1e3 * speed**2 / growth:.4g} mm; make the stroke longer or "
            "slower"
        )


def speed_of(stamps: Sequence[StageStamp]) -> float | None:
    """Speed over the middle half of a way, in m/s; None of fewer than three places in it.

    The median of the slopes of all pairs of places that lie half of that middle apart (Theil and Sen's line): a stamp
    that came late because this computer was busy does not count more than another.

    Parameters
    ----------
    stamps : sequence of StageStamp
        In the order of time, along one straight way.
    """
    time = np.array([stamp.time for stamp in stamps])
    way = _way(np.array([stamp.position for stamp in stamps]).reshape(-1, 3))
    if not len(way) or way[-1] <= 0:
        return None
    middle = (way >= 0.25 * way[-1]) & (way <= 0.75 * way[-1])
    time, way = time[middle], way[middle]
    if len(time) < 3:
        return None
    late, early = np.triu_indices(len(time), k=1)[::-1]
    far = time[late] - time[early] >= 0.5 * (time[-1] - time[0])
    late, early = late[far], early[far]
    return float(np.median((way[late] - way[early]) / (time[late] - time[early])))


def _way(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far along the line from the first to the last place each one lies, in m."""
    if len(places) < 2:
        return np.zeros(0)
    line = places[-1] - places[0]
    length = float(np.linalg.norm(line))
    return (places - places[0]) @ line / length if length > 0 else np.zeros(0)
