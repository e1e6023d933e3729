"""How a tracker lies relative to the array."""

from dataclasses import dataclass, field

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model.palm_pose import PalmPath
from midair.model.reprs import summary
from midair.validation import frozen_array


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
