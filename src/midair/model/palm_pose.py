"""Poses of a palm over time, and the placement of the tracker that measures them."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.model.reprs import summary
from midair.validation import frozen_array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PalmPath:
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

    def __repr__(self) -> str:
        return summary(self, f"{len(self.time)} poses", f"{self.time[-1] - self.time[0]:.3g} s")

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackerPlacement:
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
        if not 0 <= self.uncertainty < 1:
            raise InputError(f"uncertainty of the tracker: expected 0 to 1 m, got {self.uncertainty:g} m")

    def __repr__(self) -> str:
        place = ", ".join(f"{value * 1e3:.4g}" for value in self.offset)
        return summary(self, f"({place}) mm", f"uncertainty {self.uncertainty * 1e3:.2g} mm")

    def points(self, points: Array) -> Array:
        """Points (..., 3) of the tracker in array coordinates, in m."""
        return points @ self.rotation.T + self.offset

    def path(self, path: PalmPath) -> PalmPath:
        """Poses of the tracker in array coordinates."""
        normal, fingers = path.normal @ self.rotation.T, path.fingers @ self.rotation.T
        return PalmPath(
            time=path.time,
            centre=self.points(path.centre),
            normal=normal,
            fingers=fingers,
            confidence=path.confidence,
        )
