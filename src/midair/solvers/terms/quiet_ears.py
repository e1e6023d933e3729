"""Quiet ears: as little sound as possible where the ears of a person in front of the array are.

Nothing in the paper's error says what the field does elsewhere, and a full array makes 145 dB at the ears. The term is
the mean of ``|p|^2`` over a cube around each ear, ``lambda M mean |p|^2 / 2`` beside the squared errors of the M
control points. It is a guard without a ceiling: rows whose squares add up to that mean.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, TransducerArray
from midair.physics import Place, cone_points, transfer_matrix
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class QuietEars:
    """Where ears are, and how much the sound there counts.

    Attributes
    ----------
    weight : float
        lambda: of the mean square of the sound at the ears, over that of the error at the control points.
    positions : tuple of tuple of float
        x, y, z of each ear from the centre of the array, in m; those of the exposure profiles.
    reach : float
        Half the edge of the cube around each, in m.
    """

    weight: float = 30.0
    positions: tuple[tuple[float, float, float], ...] = ((-0.075, -0.35, 0.45), (0.075, -0.35, 0.45))
    reach: float = 0.04

    def __post_init__(self) -> None:
        positive(self.weight, "weight of quiet ears")
        positive(self.reach, "reach of quiet ears", "m")

    def rows(self, array: TransducerArray, acoustics: Acoustics) -> NDArray[np.complex128]:
        """Rows whose fields' squares add up to the mean of |p|^2 over the cubes, shape (row, transducer), in Pa."""
        ears = [Place(name="ear", position=each, reach=self.reach, limit=0.0) for each in self.positions]
        # Half as close as the bound needs them: a mean is smoother than a maximum.
        points = np.concatenate([cone_points(ear, array, acoustics, step=1.8) for ear in ears])
        field = transfer_matrix(points, array, acoustics=acoustics) / np.sqrt(len(points))
        power, vectors = np.linalg.eigh(field @ field.conj().T)
        # 40 dB below the strongest is below what phases can do anything about.
        kept = vectors[:, power > 1e-4 * power[-1]]
        return np.asarray(kept.conj().T @ field, np.complex128)
