"""Several planes as one target, each anywhere and tilted as it likes: two hands, a hand and an arm.

A `ControlGrid` is flat and parallel to the array, and files, modes and the command line know one grid only. Solvers
know none: rows of G may be points anywhere. `placed` says where a tilted grid's points are, and `problem_at` makes one
problem of all planes, which every solver of `methods.METHODS` takes.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model import Acoustics, ControlGrid, Medium, TransducerArray
from midair.physics import transfer_matrix, wavenumber
from midair.solvers.problem import Problem

Array = NDArray[np.float64]


def placed(grid: ControlGrid, *, centre: tuple[float, float, float], normal: tuple[float, float, float]) -> Array:
    """Points of a grid that is moved and tilted, row by row, shape (point, 3), in m.

    Parameters
    ----------
    grid : ControlGrid
        Rows, columns and pitch; its own height and centre do not count.
    centre : tuple of float
        Where its middle goes, in m.
    normal : tuple of float
        Where its upper side looks; of any length. The grid is turned there by the shortest way.

    Raises
    ------
    InputError
        If the upper side would look straight down, or nowhere.
    """
    length = float(np.linalg.norm(normal))
    n = np.asarray(normal, float) / max(length, 1e-300)
    if not (np.isfinite(length) and n[2] > -1 + 1e-6 and length > 0):
        raise InputError(f"normal: expected a direction that is not straight down, got {tuple(normal)}")
    x, y = np.meshgrid(grid.x, grid.y)
    flat = np.stack([x.ravel(), y.ravel(), np.zeros(grid.count)], axis=1)
    # Rodrigues' formula for the turn from z to n: axis z x n, cosine n_z.
    a, b, c = np.cross([0.0, 0.0, 1.0], n)
    across = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    turn = np.eye(3) + across + across @ across / (1 + n[2])
    return np.asarray(flat @ turn.T + np.asarray(centre, float), np.float64)


def problem_at(
    planes: Sequence[Array], amplitude: Array, array: TransducerArray, *, acoustics: Acoustics | None = None
) -> Problem:
    """The problem of meeting the targets of all planes at once.

    Parameters
    ----------
    planes : sequence of ndarray, shape (point, 3)
        Where the points of each are, in m: of `placed`, or a grid's own `position`.
    amplitude : ndarray, shape (frame, point)
        Peak sound pressure wanted at the points of the first plane, then of the second and so on, in Pa.
    array : TransducerArray
        What is to make it.
    acoustics : Acoustics, optional
        The paper's if None.

    Returns
    -------
    Problem
        In units of the strongest focus at any point; a solver's `solve` gives phases for a `Drive`.

    Raises
    ------
    ShapeError
        If there are not as many amplitudes as points.
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
    """Phases of the field with which a plane is an image of the whole array, shape (point,), in rad.

    As `lens.spreading_phase`, for a plane anywhere: psi = -k |x - f|, a wave that converges on a point behind the
    plane. Rays from all over the array, half as wide as W, through the plane, half as wide as w, meet W / (W - w)
    times as far from the middle of the array as the plane is. No wider than the plane, the array has no such point:
    then a plane wave along that line.
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
