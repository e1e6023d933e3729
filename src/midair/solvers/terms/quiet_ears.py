"""Quiet ears: minimise the sound at the ears of a person in front of the array.

The error of the paper does not include the field elsewhere, and an array at full drive makes 145 dB at the ears. The
term is ``lambda M mean |p|^2 / 2`` over a cube around each ear, beside the squared errors of the M control points. It
is a guard with ceiling 0: the squares of its rows add up to that mean.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, ControlGrid, TransducerArray
from midair.physics import Place, cone_points, transfer_matrix
from midair.solvers.terms.term import QuietTerm
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class QuietEars(QuietTerm):
    """Positions of the ears and weight of the sound there."""

    keyword = "quiet_ears"
    help = "Penalty on sound at the ears of the user; 3 is moderate, 30 strong."

    # lambda: weight of the mean square at the ears relative to that of the error at the control points
    weight: float = 30.0
    # x, y, z of each ear from the centre of the array in m; those of the exposure profiles
    positions: tuple[tuple[float, float, float], ...] = ((-0.075, -0.35, 0.45), (0.075, -0.35, 0.45))
    reach: float = 0.04  # Half the edge of the cube around each ear in m

    def __post_init__(self) -> None:
        positive(self.weight, "weight of quiet ears")
        positive(self.reach, "reach of quiet ears", "m")

    def quiet_rows(self, grid: ControlGrid) -> int:  # noqa: ARG002
        """The few components of `rows` do not count."""
        return 0

    def rows(self, grid: ControlGrid, array: TransducerArray, acoustics: Acoustics) -> NDArray[np.complex128]:  # noqa: ARG002
        """Rows whose squared fields add up to the mean of |p|^2 over the cubes, shape (row, transducer), in Pa."""
        ears = [Place(name="ear", position=each, reach=self.reach, limit=0.0) for each in self.positions]
        # Half as dense as for the exposure bound, since a mean is smoother than a maximum.
        points = np.concatenate([cone_points(ear, array, acoustics, step=1.8) for ear in ears])
        field = transfer_matrix(points, array, acoustics=acoustics) / np.sqrt(len(points))
        power, vectors = np.linalg.eigh(field @ field.conj().T)
        # Phases have no useful effect on components 40 dB below the strongest.
        kept = vectors[:, power > 1e-4 * power[-1]]
        return np.asarray(kept.conj().T @ field, np.complex128)
