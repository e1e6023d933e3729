"""A quiet palm: as little sound as possible on the skin around the square that a sensor's cells cover.

The paper's error says nothing of the field there; no cell hears it, and a palm feels what of it changes. The term is
the mean of ``|p|^2`` over that part of the palm, ``lambda M mean |p|^2 / 2`` beside the squared errors of the M control
points. Pressure goes with the square of the sound: what is a tenth of the loudest target presses a hundredth as much,
so that a quiet field needs not be steady as well. What was tried besides: docs/decisions/0029-palm.md.
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
    """Which part of a palm is to be quiet, and how much it counts.

    Attributes
    ----------
    weight : float
        lambda: of the mean square of the sound there, over that of the error at the control points.
    diameter : float
        Of the palm, a disc around the control points, in m; a little more than one, since hands are not put down to
        the millimetre.
    pitch : float
        Between the points that are looked at, in m; half a wavelength is 4.3 mm.
    outline : tuple of str
        In place of the disc, what `Palm.rows` of a hand over the middle of the array tell; letters, so that settings
        can be written down.
    outline_pitch : float
        Between two letters, in m.
    margin : float
        How much farther than the outline it is to be quiet, in m.
    """

    weight: float = 0.1
    diameter: float = 100e-3
    pitch: float = 4.25e-3
    outline: tuple[str, ...] = ()
    outline_pitch: float = 2.5e-3
    margin: float = 7.5e-3

    def __post_init__(self) -> None:
        positive(self.weight, "weight of the quiet palm")
        positive(self.diameter, "diameter of the quiet palm", "m")
        positive(self.pitch, "pitch of the quiet palm", "m")
        positive(self.outline_pitch, "pitch of the quiet palm's outline", "m")
        if not 0 <= self.margin < np.inf:
            raise InputError(f"margin of the quiet palm: expected 0 m or more, got {self.margin:g} m")

    @classmethod
    def under(cls, palm: Palm, *, weight: float = 0.1) -> "QuietPalm":
        """The term of a palm of any outline, which lies where it lies, whatever the control points do."""
        return cls(weight=weight, outline=palm.rows, outline_pitch=palm.pitch)

    def rows(self, grid: ControlGrid, array: TransducerArray, acoustics: Acoustics) -> NDArray[np.complex128]:
        """Rows whose fields' squares add up to the mean of ``|p|^2`` on a palm around a grid, (row, transducer), Pa.

        Raises
        ------
        InputError
            If the grid covers the palm.
        """
        points = self.points(grid)
        return transfer_matrix(points, array, acoustics=acoustics) / np.sqrt(len(points))

    def points(self, grid: ControlGrid) -> NDArray[np.float64]:
        """Where on the palm it is to be quiet, shape (row, 3), in m.

        Raises
        ------
        InputError
            If the grid covers the palm.
        """
        skin, half = self._skin(grid), np.array([grid.columns, grid.rows]) * grid.pitch / 2
        # A nanometre more: points on the edge itself must not depend on rounding.
        beyond = skin[(np.abs(skin[:, :2] - np.asarray(grid.centre)) > half + 1e-9).any(axis=1)]
        if not len(beyond):
            said = "an outline" if self.outline else f"a disc of {1e3 * self.diameter:g} mm"
            raise InputError(
                f"quiet palm: expected one larger than the control points, got {said} "
                f"around {1e3 * grid.columns * grid.pitch:g} x {1e3 * grid.rows * grid.pitch:g} mm"
            )
        return beyond

    def _skin(self, grid: ControlGrid) -> NDArray[np.float64]:
        """All points of the palm, shape (point, 3), in m."""
        if self.outline:
            palm = Palm.of_rows(self.outline, pitch=self.outline_pitch).wider(self.margin, pitch=self.pitch)
            return palm.grid(grid.height).position[palm.inside.ravel()]
        palm = Palm.disc(self.diameter, pitch=self.pitch)
        return palm.grid(grid.height).position[palm.inside.ravel()] + np.array([*grid.centre, 0.0])
