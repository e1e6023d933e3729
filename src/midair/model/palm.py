"""The outline of a palm above the array, its poses over time, and the placement of the tracker that measures them."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.model.geometry import ControlGrid, centred
from midair.model.provenance import Brief
from midair.validation import frozen_array, length, within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Palm(Brief):
    """Points of a grid that are skin; the centre of the grid is above the centre of the array."""

    inside: NDArray[np.bool_]
    """True for points on skin, shape (row, column)."""
    pitch: float = 2.5e-3
    """Distance between the points, in m.

    Radiation pressure varies over half a wavelength or more, so that two points per period (2.1 mm at 40 kHz) sample
    any field; 2.5 mm suffice for the field of four units at 20 cm."""
    name: str = "palm"

    def __post_init__(self) -> None:
        object.__setattr__(self, "inside", frozen_array(self.inside, "palm", ("row", "column"), np.bool_))
        length(self.pitch, "pitch of the palm", (0.2e-3, 20e-3))
        if not self.inside.any():
            raise InputError("palm: expected some skin under the array, got none; move the outline")

    @classmethod
    def disc(cls, diameter: float = 85e-3, *, pitch: float = 2.5e-3) -> "Palm":
        """A round palm; 85 mm is the breadth of a man's palm."""
        within(diameter, "diameter of the palm", 0, 1, unit="m", above=True)
        place = centred(2 * int(diameter / 2 / length(pitch, "pitch of the palm", (0.2e-3, 20e-3))) + 1, pitch)
        inside = np.hypot(place, place[:, None]) <= diameter / 2
        return cls(inside=inside, pitch=pitch, name=f"disc of {1e3 * diameter:g} mm")

    @classmethod
    def within(cls, outline: Array, *, pitch: float = 2.5e-3, name: str = "palm") -> "Palm":
        """The area inside a closed outline.

        `outline`, shape (corner, 2), holds x and y of the corners relative to the centre of the array, in m; the last
        is joined to the first. Raises ShapeError if there are fewer than three corners.
        """
        corners = frozen_array(outline, "outline of the palm", ("corner", 2))
        if len(corners) < 3:
            raise ShapeError(f"outline of the palm: expected three corners or more, got {len(corners)}")
        length(float(np.abs(corners).max()), "farthest corner of the palm", (0, 0.5))
        half_x, half_y = np.abs(corners).max(axis=0)
        x, y = (centred(2 * int(half / pitch) + 1, pitch) for half in (half_x, half_y))
        return cls(inside=_enclosed(corners, *np.meshgrid(x, y)), pitch=pitch, name=name)

    @classmethod
    def of_rows(cls, rows: tuple[str, ...], *, pitch: float = 2.5e-3, name: str = "palm") -> "Palm":
        """The palm that `rows` of text describe (see `rows`).

        Raises ShapeError if the rows differ in length.
        """
        if len({len(row) for row in rows}) > 1:
            raise ShapeError(f"palm: expected rows of one length, got {min(map(len, rows))} to {max(map(len, rows))}")
        return cls(inside=np.array([[mark == "#" for mark in row] for row in rows]), pitch=pitch, name=name)

    @property
    def rows(self) -> tuple[str, ...]:
        """The points as text: # for skin, a dot for the rest."""
        return tuple("".join("#" if skin else "." for skin in row) for row in self.inside)

    def wider(self, margin: float, *, pitch: float) -> "Palm":
        """All points at most `margin` away from the skin, on a grid of another pitch; both in m."""
        skin = self.grid(1.0).position[self.inside.ravel(), :2]
        # A point of skin stands for a square that extends half a pitch around it.
        reach = margin + self.pitch / 2
        half_y, half_x = ((count - 1) / 2 * self.pitch + reach for count in self.inside.shape)
        x, y = (centred(2 * int(half / pitch) + 1, pitch) for half in (half_x, half_y))
        points = np.stack(np.meshgrid(x, y), axis=-1)
        away, _ = scipy.spatial.cKDTree(skin).query(points)
        return Palm(inside=np.asarray(away <= reach), pitch=pitch, name=self.name)

    def grid(self, height: float) -> ControlGrid:
        """The control grid that `inside` refers to, at a height above the array in m."""
        rows, columns = self.inside.shape
        return ControlGrid(rows=rows, columns=columns, pitch=self.pitch, height=height)

    def points(self, centre: Array) -> Array:
        """Points of the skin parallel to z = 0 around a centre (3,) in m, shape (point, 3)."""
        x, y = np.meshgrid(*(centred(count, self.pitch) for count in self.inside.shape[::-1]))
        return np.stack([x, y, 0 * x], axis=-1)[self.inside] + centre

    def beyond(self, reach_x: float, reach_y: float) -> NDArray[np.bool_]:
        """True for skin farther from the centre than the given distances, in m, shape (row, column)."""
        x, y = np.meshgrid(*(centred(count, self.pitch) for count in self.inside.shape[::-1]))
        return self.inside & ((np.abs(x) > reach_x + 1e-9) | (np.abs(y) > reach_y + 1e-9))


def _enclosed(corners: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Points from which a ray crosses the outline an odd number of times."""
    odd = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if y0 != y1:
            odd ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return odd


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PalmPath(Brief):
    """Poses of a palm in array coordinates, in order of time; one pose is a path of length 1."""

    time: Array
    """Time of each pose in s, increasing."""
    centre: Array
    """Centre of the palm, shape (pose, 3), in m."""
    normal: Array
    """Unit normal out of the palm, shape (pose, 3); (0, 0, -1) faces the array."""
    fingers: Array
    """Unit direction of the fingers, at right angles to the normal, shape (pose, 3)."""
    confidence: Array
    """Confidence of the tracker, 0 to 1."""

    def __post_init__(self) -> None:
        for name in ("time", "confidence"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), f"{name} of the palm", ("pose",)))
        for name in ("centre", "normal", "fingers"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), f"{name} of the palm", ("pose", 3)))
        count = len(self.time)
        if any(len(getattr(self, name)) != count for name in ("centre", "normal", "fingers", "confidence")):
            raise InputError(f"poses of the palm: expected one of each value for each time, got {count} times")
        if count > 1 and np.diff(self.time).min() <= 0:
            at = int(np.diff(self.time).argmin()) + 1
            raise InputError(f"poses of the palm: expected increasing times, got {self.time[at]:g} s at pose {at + 1}")
        for name in ("normal", "fingers"):
            length = np.linalg.norm(getattr(self, name), axis=1)
            if np.abs(length - 1).max() > 1e-2:
                raise InputError(f"{name} of the palm: expected vectors of length 1, got {length.min():g} or less")
        if not ((self.confidence >= 0) & (self.confidence <= 1)).all():
            raise InputError("confidence of the palm: expected 0 to 1")

    @classmethod
    def from_rows(cls, rows: Array) -> Self:
        """Poses from rows (pose, 11): time, centre, normal, fingers, confidence."""
        return cls(
            time=rows[:, 0], centre=rows[:, 1:4], normal=rows[:, 4:7], fingers=rows[:, 7:10], confidence=rows[:, 10]
        )

    @property
    def rows(self) -> Array:
        """Shape (pose, 11): time, centre, normal, fingers, confidence."""
        parts = [self.time, self.centre, self.normal, self.fingers, self.confidence]
        return frozen_array(np.column_stack(parts), "poses of the palm", ("pose", 11))

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Rotations (pose, 3, 3) whose columns are the palm's x, y (fingers) and z (minus the normal) axes."""
        z = -self.normal
        y = self.fingers - (self.fingers * z).sum(axis=1, keepdims=True) * z
        y = y / np.linalg.norm(y, axis=1, keepdims=True)
        return np.asarray(np.stack([np.cross(y, z), y, z], axis=-1), np.float64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class TrackerPlacement(Brief):
    """Rotation and offset from the coordinates of a tracker (x to the right, y away, z up) to those of the array."""

    rotation: Array = field(default_factory=lambda: np.eye(3))
    """Shape (3, 3), right-handed: array = rotation @ tracker + offset."""
    offset: Array = field(default_factory=lambda: np.zeros(3))
    """Shape (3,): place of the tracker's origin in array coordinates, in m."""
    uncertainty: float = 0.0
    """Standard uncertainty of a placed point between the places that were measured, in m; 0 if not measured."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen_array(self.rotation, "rotation of the tracker", (3, 3)))
        object.__setattr__(self, "offset", frozen_array(self.offset, "offset of the tracker", (3,)))
        off = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if off > 1e-6 or np.linalg.det(self.rotation) < 0:
            raise InputError(f"rotation of the tracker: expected a rotation without a mirror, off by {off:.2g}")
        within(self.uncertainty, "uncertainty of the tracker", 0, 1, unit="m")

    def points(self, points: Array) -> Array:
        """Points (..., 3) of the tracker in array coordinates, in m."""
        return points @ self.rotation.T + self.offset

    def path(self, path: PalmPath) -> PalmPath:
        """Poses of the tracker in array coordinates."""
        normal, fingers = path.normal @ self.rotation.T, path.fingers @ self.rotation.T
        return PalmPath(
            time=path.time, centre=self.points(path.centre), normal=normal, fingers=fingers, confidence=path.confidence
        )
