"""Frames of a drive and their complex products with a field, in single precision, written into reused arrays."""

from dataclasses import dataclass
from math import prod
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Single
from midair.model import Drive


class Workspace:
    """Named arrays that are reused, for one thread.

    Allocating new ones for each block of frames would take as long as the computation, because the system clears new
    pages.
    """

    def __init__(self) -> None:
        self._kept: dict[str, Single] = {}

    def array(self, name: str, *shape: int) -> Single:
        """The array of that name, with undefined content."""
        size, held = prod(shape), self._kept.get(name)
        if held is None or held.size < size:
            held = self._kept[name] = np.empty(size, np.float32)
        return held[:size].reshape(shape)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Product:
    """Multiplication by a complex matrix with three real products instead of four (Gauss)."""

    real: Single  # Real part of the matrix, shape (in, out)
    less: Single  # Imaginary minus real part
    more: Single  # Imaginary plus real part

    @classmethod
    def of(cls, matrix: NDArray[np.complexfloating]) -> Self:
        """Make it from a matrix of shape (in, out)."""
        real, imaginary = matrix.real, matrix.imag
        packed = (np.ascontiguousarray(each, np.float32) for each in (real, imaginary - real, imaginary + real))
        return cls(**dict(zip(("real", "less", "more"), packed, strict=True)))

    @property
    def width(self) -> int:
        """Number of outputs."""
        return self.real.shape[1]

    def into(self, found: Single, parts: Single, space: Workspace) -> None:
        """Write real and imaginary part of the product into `found`, float32 (2 or more, frame, out).

        `parts` is float32 (3, frame, in): real parts, imaginary parts, and their sums.
        """
        real, imaginary, both = parts
        shared = np.matmul(both, self.real, out=space.array("shared", len(both), self.width))
        np.matmul(imaginary, self.more, out=found[0])
        np.subtract(shared, found[0], out=found[0])
        np.matmul(real, self.less, out=found[1])
        np.add(shared, found[1], out=found[1])


def power_of(field: Single) -> Single:
    """Squared magnitude, shape (frame, point), of (real and imaginary, frame, point), which is overwritten."""
    np.multiply(field, field, out=field)
    return np.add(field[0], field[1], out=field[0])


def drive_parts(
    drive: Drive, frames: slice | NDArray[np.intp], space: Workspace, *, steps: int | None = None
) -> tuple[Single, Array]:
    """Some frames as float32 (3, frame, transducer), and their level (frame, 1) or (frame, transducer).

    A level common to all transducers of a frame is not yet included in the parts. `steps` rounds phases to that many
    steps per turn.
    """
    phase = np.asarray(drive.phase[frames])
    level = np.asarray(drive.level[frames]).reshape(len(phase), -1)
    parts, angle = space.array("parts", 3, *phase.shape), space.array("angle", *phase.shape)
    with np.errstate(over="ignore"):
        angle[:] = phase
    # Remove whole turns, which would cost digits in single precision; files may contain any phase.
    if max(angle.max(initial=0.0), -angle.min(initial=0.0)) > 64:
        angle[:] = np.remainder(phase, 2 * np.pi)
    if steps is not None:
        angle *= steps / (2 * np.pi)
        np.rint(angle, out=angle)
        angle *= 2 * np.pi / steps
    np.cos(angle, out=parts[0])
    np.sin(angle, out=parts[1])
    if level.shape[1] > 1:
        parts[:2] *= level.astype(np.float32)
    np.add(parts[0], parts[1], out=parts[2])
    return parts, level
