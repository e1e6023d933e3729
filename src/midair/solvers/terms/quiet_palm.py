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
    """

    weight: float = 0.1
    diameter: float = 100e-3
    pitch: float = 4.25e-3

    def __post_init__(self) -> None:
        positive(self.weight, "weight of the quiet palm")
        positive(self.diameter, "diameter of the quiet palm", "m")
        positive(self.pitch, "pitch of the quiet palm", "m")

    def rows(self, grid: ControlGrid, array: TransducerArray, acoustics: Acoustics) -> NDArray[np.complex128]:
        """Rows whose fields' squares add up to the mean of |p|^2 on the palm around a grid, (row, transducer), in Pa.

        Raises
        ------
        InputError
            If the grid covers the palm.
        """
        palm = Palm.disc(self.diameter, pitch=self.pitch)
        beyond = palm.beyond(grid.columns * grid.pitch / 2, grid.rows * grid.pitch / 2).ravel()
        if not beyond.any():
            raise InputError(
                f"quiet palm: expected a disc larger than the control points, got one of {1e3 * self.diameter:g} mm "
                f"around {1e3 * grid.columns * grid.pitch:g} x {1e3 * grid.rows * grid.pitch:g} mm"
            )
        points = palm.grid(grid.height).position[beyond] + np.array([*grid.centre, 0.0])
        return transfer_matrix(points, array, acoustics=acoustics) / np.sqrt(len(points))
