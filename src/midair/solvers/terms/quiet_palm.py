"""Quiet palm: minimise the sound on the skin around the square that the sensor's cells cover.

The error of the paper does not include the field there; no cell measures it, but a palm feels its changes. The term is
``lambda M mean |p|^2 / 2`` over that part of the palm, beside the squared errors of the M control points. Pressure is
proportional to the squared sound, so a tenth of the loudest target gives a hundredth of its pressure.
docs/decisions/0029-palm.md lists the alternatives.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Acoustics, ControlGrid, Palm, TransducerArray
from midair.physics import transfer_matrix
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class QuietPalm:
    """Part of a palm that shall be quiet, and its weight."""

    weight: float = 0.1
    """lambda: weight of the mean square on the palm relative to that of the error at the control points."""
    diameter: float = 100e-3
    """Diameter in m of the palm, a disc around the control points; larger than a real palm, to allow for its
    position.
    """
    pitch: float = 4.25e-3
    """Distance between the points in m; half a wavelength is 4.3 mm."""
    outline: tuple[str, ...] = ()
    """Shape of the palm as `Palm.rows` (text), centred on the array, in place of the disc."""
    outline_pitch: float = 2.5e-3
    """Distance between two letters of the outline in m."""
    margin: float = 7.5e-3
    """Width in m around the outline that shall be quiet, too."""

    def __post_init__(self) -> None:
        positive(self.weight, "weight of the quiet palm")
        positive(self.diameter, "diameter of the quiet palm", "m")
        positive(self.pitch, "pitch of the quiet palm", "m")
        positive(self.outline_pitch, "pitch of the quiet palm's outline", "m")
        if not 0 <= self.margin < np.inf:
            raise InputError(f"margin of the quiet palm: expected 0 m or more, got {self.margin:g} m")

    @classmethod
    def under(cls, palm: Palm, *, weight: float = 0.1) -> "QuietPalm":
        """The term for a palm of any outline at a fixed place, independent of the control points."""
        return cls(weight=weight, outline=palm.rows, outline_pitch=palm.pitch)

    def points(self, grid: ControlGrid) -> NDArray[np.float64]:
        """Points of the palm outside the grid, shape (row, 3), in m.

        Raises InputError if the grid covers the palm.
        """
        skin, half = self._skin(grid), np.array([grid.columns, grid.rows]) * grid.pitch / 2
        # One nanometre of margin, so that points on the edge do not depend on rounding.
        beyond = skin[(np.abs(skin[:, :2] - np.asarray(grid.centre)) > half + 1e-9).any(axis=1)]
        if not len(beyond):
            shape = "an outline" if self.outline else f"a disc of {1e3 * self.diameter:g} mm"
            raise InputError(
                f"quiet palm: expected a palm larger than the control grid, got {shape} "
                f"around {1e3 * grid.columns * grid.pitch:g} x {1e3 * grid.rows * grid.pitch:g} mm"
            )
        return beyond

    def count(self, grid: ControlGrid) -> int:
        """Number of `rows`."""
        return len(self.points(grid))

    def rows(self, grid: ControlGrid, array: TransducerArray, acoustics: Acoustics) -> NDArray[np.complex128]:
        """Rows (row, transducer) in Pa whose squared fields add up to the mean of ``|p|^2`` over the points."""
        points = self.points(grid)
        return transfer_matrix(points, array, acoustics=acoustics) / np.sqrt(len(points))

    def _skin(self, grid: ControlGrid) -> NDArray[np.float64]:
        """All points of the palm, shape (point, 3), in m."""
        if self.outline:
            palm = Palm.of_rows(self.outline, pitch=self.outline_pitch).wider(self.margin, pitch=self.pitch)
            return palm.grid(grid.height).position[palm.inside.ravel()]
        palm = Palm.disc(self.diameter, pitch=self.pitch)
        return palm.grid(grid.height).position[palm.inside.ravel()] + np.array([*grid.centre, 0.0])
