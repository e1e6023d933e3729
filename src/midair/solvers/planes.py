"""Targets on several planes at any place and tilt, such as two hands, or a hand and an arm.

A `ControlGrid` is flat and parallel to the array; files and the command line support only one. A solver accepts rows of
G for points anywhere: `place_grid` gives the points of a tilted grid, `multi_plane_problem` makes one problem of
all planes.
"""

from collections.abc import Sequence

import numpy as np

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.model import Acoustics, ControlGrid, Medium, TransducerArray
from midair.physics import transfer_matrix, wavenumber
from midair.solvers.problem import Problem


def place_grid(grid: ControlGrid, *, centre: tuple[float, float, float], normal: tuple[float, float, float]) -> Array:
    """Points of a grid that is moved and tilted, row by row, shape (point, 3), in m.

    The grid gives rows, columns and pitch. `centre` is the position of its middle in m, `normal` the direction of its
    upper side, of any length; it is rotated there by the smallest angle. Raises InputError if the normal is zero, not
    finite, or points straight down.
    """
    length = float(np.linalg.norm(normal))
    if not (0 < length < np.inf and normal[2] / length > -1 + 1e-6):
        raise InputError(f"normal: expected a direction that is not straight down, got {tuple(normal)}")
    from scipy.spatial.transform import Rotation

    flat = grid.position - [*grid.centre, grid.height]
    return np.asarray(Rotation.align_vectors([normal], [[0.0, 0.0, 1.0]])[0].apply(flat) + centre, np.float64)


def multi_plane_problem(
    planes: Sequence[Array], amplitude: Array, array: TransducerArray, *, acoustics: Acoustics | None = None
) -> Problem:
    """One problem for the targets of all planes, for the `solve` method of a solver, in units of the strongest focus.

    `planes` are points of each plane in m, shape (point, 3), from `place_grid` or the `position` of a grid; `amplitude`
    the target peak sound pressure in Pa, shape (frame, point), at the points of the first plane, then of the second and
    so on. Raises ShapeError if the number of amplitudes differs from the number of points.
    """
    acoustics = acoustics or Acoustics()
    points = sum(len(plane) for plane in planes)
    if np.ndim(amplitude) != 2 or np.shape(amplitude)[1] != points:
        raise ShapeError(f"amplitude: expected shape (frame, {points}), got {np.shape(amplitude)}")
    G = transfer_matrix(np.concatenate(planes), array, acoustics=acoustics)
    focus = float(np.abs(G).sum(axis=1).max())
    np.divide(G, focus, out=G)
    return Problem(
        G=G,
        amplitude=np.asarray(amplitude, float) / focus,
        psi=np.concatenate([converging_phase(plane, array, acoustics.medium) for plane in planes]),
        position=array.position,
    )


def converging_phase(places: Array, array: TransducerArray, medium: Medium) -> Array:
    """Phases of the field that map the whole array onto a plane, shape (point,), in rad.

    Like `phases.spreading_phase`, for a plane anywhere: psi = -k |x - f|, a wave that converges on a point f
    behind the plane. Rays from the array of half width W through the plane of half width w meet at W / (W - w) times
    the distance between the centres. If the array is not wider than the plane, a plane wave along that line.
    """
    start, middle = array.position.mean(axis=0), places.mean(axis=0)
    k = wavenumber(array, medium)
    w = float(np.abs(places - middle).max())
    W = float(np.ptp(array.position[:, :2], axis=0).min()) / 2
    if w >= W:
        along = (middle - start) / np.linalg.norm(middle - start)
        return np.asarray(k * ((places - middle) @ along), np.float64)
    focus = start + (middle - start) * W / (W - w)
    return np.asarray(-k * np.linalg.norm(places - focus, axis=1), np.float64)
