"""Interpolation of a complex field to a finer grid, with one real matrix for rows and one for columns.

The complex pressure in a plane is smooth on the scale of half a wavelength, its magnitude is not: interpolating
magnitudes gives errors of 10 %, interpolating complex fields 1 %.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.model import Acoustics, ControlGrid, TransducerArray
from midair.physics import transfer_matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterpolatedField:
    """Interpolation from a control grid to `finer_points`: ``down @ field @ across.T``."""

    down: Array
    """Real, shape (finer row, row)."""
    across: Array
    """Real, shape (finer column, column)."""

    def __call__(self, field: Complex) -> Complex:
        """Map a field (..., row, column) to (..., finer row, finer column)."""
        return np.asarray(self.down @ field @ self.across.T, np.complex128)


def finer_points(grid: ControlGrid, times: int = 4) -> Array:
    """Return the positions of the finer field, row by row, shape (finer point, 3), in m.

    Each side has `times` as many points, equally spaced from the first control point to the last.
    """
    x, y = np.meshgrid(_between(grid.x, times) + grid.centre[0], _between(grid.y, times) + grid.centre[1])
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, grid.height)], axis=1)


def fit_interpolation(
    grid: ControlGrid,
    array: TransducerArray,
    *,
    acoustics: Acoustics | None = None,
    times: int = 4,
    lines: int = 4,
    noise: float = 0.003,
) -> InterpolatedField:
    """Fit the two matrices with the smallest mean error over all fields of the array with random phases.

    Least squares over the fields of the single transducers on `lines` rows and columns of the grid, which get `times`
    as many points per side. `noise` is the relative rms error of the known field, by default that of 8-bit counts.
    """
    x, y = grid.x + grid.centre[0], grid.y + grid.centre[1]
    fine_x, fine_y = _between(x, times), _between(y, times)

    def field(some_x: Array, some_y: Array) -> Complex:
        places = np.stack(np.meshgrid(some_x, some_y), axis=-1).reshape(-1, 2)
        points = np.column_stack([places, np.full(len(places), grid.height)])
        made = transfer_matrix(points, array, acoustics=acoustics)
        return made.reshape(len(some_y), len(some_x), array.count)

    rows, columns = y[_spread(len(y), lines)], x[_spread(len(x), lines)]
    return InterpolatedField(
        down=_fitted(field(columns, y).swapaxes(0, 1), field(columns, fine_y).swapaxes(0, 1), noise),
        across=_fitted(field(x, rows), field(fine_x, rows), noise),
    )


def _between(places: Array, times: int) -> Array:
    """Return `times` as many equally spaced values from the first to the last."""
    return np.linspace(places[0], places[-1], times * len(places))


def _spread(count: int, some: int) -> NDArray[np.intp]:
    """Return indices of some lines, evenly from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(some, count)).round().astype(np.intp))


def _fitted(known: Complex, wanted: Complex, noise: float) -> Array:
    """Real matrix that maps lines (line, place, transducer) to (line, finer place, transducer)."""
    before, after = _real_lines(known), _real_lines(wanted)
    moments = before @ before.T
    # Regularised by the noise: otherwise the matrix amplifies the steps of 8 bits several hundred times.
    held = moments + noise**2 * np.trace(moments) / len(moments) * np.eye(len(moments))
    return np.asarray(np.linalg.solve(held, before @ after.T).T, np.float64)


def _real_lines(lines: Complex) -> Array:
    """Concatenate all lines to (place, line), with real and imaginary parts as separate lines."""
    beside = lines.swapaxes(0, 1).reshape(lines.shape[1], -1)
    return np.hstack([beside.real, beside.imag])
