"""Products of complex matrices in single precision, into arrays that are kept."""

from dataclasses import dataclass
from math import prod
from typing import Self

import numpy as np
from numpy.typing import NDArray

Single = NDArray[np.float32]


class Workspace:
    """Arrays by name that are written again and again, for one thread.

    New ones for each block of frames would take as long as the sums: the system clears every page that it hands out.
    """

    def __init__(self) -> None:
        self._kept: dict[str, Single] = {}

    def array(self, name: str, *shape: int) -> Single:
        """The array of that name, of any numbers that were left in it."""
        size, held = prod(shape), self._kept.get(name)
        if held is None or held.size < size:
            held = self._kept[name] = np.empty(size, np.float32)
        return held[:size].reshape(shape)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Product:
    """Complex numbers times a complex matrix, by three products of real matrices in place of four (Gauss).

    Attributes
    ----------
    real, less, more : ndarray of float32, shape (in, out)
        Of the matrix: its real part, its imaginary less its real part, and their sum.
    """

    real: Single
    less: Single
    more: Single

    @classmethod
    def of(cls, matrix: NDArray[np.complexfloating]) -> Self:
        """By a matrix, shape (in, out)."""
        real, imaginary = matrix.real, matrix.imag
        packed = (np.ascontiguousarray(each, np.float32) for each in (real, imaginary - real, imaginary + real))
        return cls(**dict(zip(("real", "less", "more"), packed, strict=True)))

    @property
    def width(self) -> int:
        """How many numbers come out."""
        return self.real.shape[1]

    def into(self, found: Single, parts: Single, space: Workspace) -> None:
        """Work out the product.

        Parameters
        ----------
        found : ndarray of float32, shape (2 or more, frame, out)
            Where its real and its imaginary parts go.
        parts : ndarray of float32, shape (3, frame, in)
            Real parts, imaginary parts, and their sums.
        space : Workspace
            For what is between.
        """
        real, imaginary, both = parts
        shared = np.matmul(both, self.real, out=space.array("shared", len(both), self.width))
        np.matmul(imaginary, self.more, out=found[0])
        np.subtract(shared, found[0], out=found[0])
        np.matmul(real, self.less, out=found[1])
        np.add(shared, found[1], out=found[1])


def power_of(there: Single) -> Single:
    """Squared magnitude, shape (frame, point), of (real and imaginary, frame, point), which is overwritten."""
    np.multiply(there, there, out=there)
    return np.add(there[0], there[1], out=there[0])
