"""The outline of a palm above the array: which points of a grid are skin."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.model.geometry import ControlGrid, centred
from midair.model.reprs import clipped, summary
from midair.validation import frozen_array, positive


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Palm:
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
        positive(self.pitch, "pitch of the palm", "m")
        if not self.inside.any():
            raise InputError("palm: expected some skin under the array, got none; move the outline")

    def __repr__(self) -> str:
        area = 1e4 * self.inside.sum() * self.pitch**2
        return summary(self, clipped(self.name), f"{area:.3g} cm2", f"points {1e3 * self.pitch:g} mm apart")

    @classmethod
    def disc(cls, diameter: float = 85e-3, *, pitch: float = 2.5e-3) -> "Palm":
        """A round palm; 85 mm is the breadth of a man's palm."""
        positive(diameter, "diameter of the palm", "m")
        place = centred(2 * int(diameter / 2 / positive(pitch, "pitch of the palm", "m")) + 1, pitch)
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
        from scipy.spatial import cKDTree

        skin = self.grid(1.0).position[self.inside.ravel(), :2]
        # A point of skin stands for a square that extends half a pitch around it.
        reach = margin + self.pitch / 2
        half_y, half_x = ((count - 1) / 2 * self.pitch + reach for count in self.inside.shape)
        x, y = (centred(2 * int(half / pitch) + 1, pitch) for half in (half_x, half_y))
        points = np.stack(np.meshgrid(x, y), axis=-1)
        away, _ = cKDTree(skin).query(points)
        return Palm(inside=np.asarray(away <= reach), pitch=pitch, name=self.name)

    def grid(self, height: float) -> ControlGrid:
        """The control grid that `inside` refers to, at a height above the array in m."""
        rows, columns = self.inside.shape
        return ControlGrid(rows=rows, columns=columns, pitch=self.pitch, height=height)

    def beyond(self, reach_x: float, reach_y: float) -> NDArray[np.bool_]:
        """True for skin farther from the centre than the given distances, in m, shape (row, column)."""
        rows, columns = self.inside.shape
        x, y = np.meshgrid(centred(columns, self.pitch), centred(rows, self.pitch))
        return self.inside & ((np.abs(x) > reach_x + 1e-9) | (np.abs(y) > reach_y + 1e-9))


def _enclosed(corners: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Points from which a ray crosses the outline an odd number of times."""
    odd = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if y0 != y1:
            odd ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return odd
