"""Positions and rotations of the units of an AUTD3 array."""

from dataclasses import dataclass

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model.geometry import TransducerArray
from midair.model.reprs import clipped
from midair.validation import frozen_array

UNIT = TransducerArray.autd3(columns=1, rows=1).count
"""Number of transducers of one unit."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placement:
    """Position and rotation of each unit."""

    position: Array
    """Position of each unit's first transducer, shape (unit, 3), in m."""
    rotation: Array
    """Rotation about the fixed x, then y, then z axis, shape (unit, 3), in rad."""
    name: str = "AUTD3"
    """Name of the array."""

    def __post_init__(self) -> None:
        position = frozen_array(self.position, "unit position", ("unit", 3))
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "rotation", frozen_array(self.rotation, "unit rotation", (len(position), 3)))

    @classmethod
    def grid(cls, *, columns: int = 2, rows: int = 2) -> "Placement":
        """Units side by side in one plane, 192.0 x 151.4 mm apart, row by row."""
        if columns < 1 or rows < 1:
            raise InputError(f"units: expected at least 1 x 1, got {columns} x {rows}")
        corners = np.array([(i * 192.0e-3, j * 151.4e-3, 0.0) for j in range(rows) for i in range(columns)])
        return cls(position=corners, rotation=np.zeros_like(corners), name=f"AUTD3 {columns} x {rows}")

    @property
    def units(self) -> int:
        """Number of units."""
        return len(self.position)

    @property
    def quaternion(self) -> Array:
        """Rotation of each unit as a quaternion (w, x, y, z), the order of both SDKs, shape (unit, 4)."""
        from scipy.spatial.transform import Rotation

        # SciPy puts w last, the SDKs put it first.
        return np.roll(np.asarray(Rotation.from_euler("xyz", self.rotation).as_quat(), np.float64), 1, axis=1)

    @property
    def origin(self) -> Array:
        """Position of each unit's first transducer in the centred array, shape (unit, 3), in m."""
        return self.position - self._transducers().mean(axis=(0, 1))

    def array(self) -> TransducerArray:
        """The transducers, unit by unit, in the order of the firmware."""
        position = self._transducers()
        normal = self._turned(np.array([[0.0, 0.0, 1.0]]))
        return TransducerArray(
            position=(position - position.mean(axis=(0, 1))).reshape(-1, 3),
            normal=np.repeat(normal, position.shape[1], axis=0).reshape(-1, 3),
            unit=np.repeat(np.arange(self.units), position.shape[1]),
            name=self.name,
        )

    def _transducers(self) -> Array:
        one = TransducerArray.autd3(columns=1, rows=1).position
        return self._turned(one - one[0]) + self.position[:, None]

    def _turned(self, points: Array) -> Array:
        from scipy.spatial.transform import Rotation

        return np.stack([turn.apply(points) for turn in Rotation.from_euler("xyz", self.rotation)])

    def __repr__(self) -> str:
        return f"<Placement of {self.units} units, '{clipped(self.name)}'>"
