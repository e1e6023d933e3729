"""Quiet ears: minimise the sound at the ears of a person in front of the array.

The error of the paper does not include the field elsewhere, and an array at full drive makes 145 dB at the ears. The
term is ``lambda M mean |p|^2 / 2`` over a cube around each ear, beside the squared errors of the M control points. It
is a guard with ceiling 0: the squares of its rows add up to that mean.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Acoustics, ControlGrid, Medium, TransducerArray
from midair.physics import Place, cone_points, transfer_matrix
from midair.validation import positive

_AIRS = 5
"""Airs of a range of temperatures; the phases of 14 to 30 °C change by 1.3 rad at most from one to the next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class QuietEars:
    """Positions of the ears and weight of the sound there."""

    # lambda: weight of the mean square at the ears relative to that of the error at the control points
    weight: float = 30.0
    # x, y, z of the first ear from the centre of the array in m, of the second, ...; those of the exposure profiles
    positions: tuple[float, ...] = (-0.075, -0.35, 0.45, 0.075, -0.35, 0.45)
    reach: float = 0.04  # Half the edge of the cube around each ear in m
    # Range of the room's temperature in degrees Celsius in which the ears shall be quiet; only the solved air if None.
    # More rows than others solve well: for method free.
    temperatures: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        positive(self.weight, "weight of quiet ears")
        positive(self.reach, "reach of quiet ears", "m")
        if not self.positions or len(self.positions) % 3:
            raise InputError(f"positions: expected x, y, z of each ear in m, got {len(self.positions)} numbers")

    @property
    def ears(self) -> list[Place]:
        """The cubes around the ears."""
        each = np.reshape(self.positions, (-1, 3)).tolist()
        return [Place(name="ear", position=(x, y, z), reach=self.reach, limit=0.0) for x, y, z in each]

    def count(self, grid: ControlGrid) -> int:  # noqa: ARG002
        """Largest number of `rows`, for the estimate of memory; the few components in one air do not count."""
        # Points of a place in an air, for four units; fewer for smaller arrays.
        return 0 if self.temperatures is None else 150 * len(self.ears) * _AIRS

    def rows(self, grid: ControlGrid, array: TransducerArray, acoustics: Acoustics) -> NDArray[np.complex128]:  # noqa: ARG002
        """Rows whose squared fields add up to the mean square of p over the cubes, shape (row, transducer), in Pa."""
        if self.temperatures is not None:
            return _rows_in_airs(self, array, acoustics)
        # Half as dense as for the exposure bound, since a mean is smoother than a maximum.
        points = np.concatenate([cone_points(ear, array, acoustics, step=1.8) for ear in self.ears])
        field = transfer_matrix(points, array, acoustics=acoustics) / np.sqrt(len(points))
        power, vectors = np.linalg.eigh(field @ field.conj().T)
        # Phases have no useful effect on components 40 dB below the strongest.
        kept = vectors[:, power > 1e-4 * power[-1]]
        return np.asarray(kept.conj().T @ field, np.complex128)


# Each part of a recording asks for the same rows.
@lru_cache(maxsize=2)
def _rows_in_airs(ears: QuietEars, array: TransducerArray, acoustics: Acoustics) -> NDArray[np.complex128]:
    """The rows at all points in several airs, of the lowest humidity where sound is loudest."""
    fields: list[NDArray[np.complex128]] = []
    for degrees in np.linspace(*(ears.temperatures or (0.0, 0.0)), _AIRS):
        air = replace(acoustics, medium=Medium.at(temperature=float(degrees), humidity=0.1))
        for ear in ears.ears:
            points = cone_points(ear, array, air, step=2.6)
            fields.append(transfer_matrix(points, array, acoustics=air) / np.sqrt(len(points)))
    return np.concatenate(fields) / np.sqrt(_AIRS * len(ears.ears))
