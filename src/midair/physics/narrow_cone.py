"""Few points that stand for a cube to which sound comes from a narrow cone."""

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, TransducerArray
from midair.physics.exposure_places import Place
from midair.physics.propagation import wavenumber

Array = NDArray[np.float64]


def cone_points(place: Place, array: TransducerArray, acoustics: Acoustics, *, step: float) -> Array:
    """Points of a place's cube, as close as the sound that reaches it can change, shape (point, 3), in m.

    Across the cone they stand like the white squares of a chessboard, along it in prisms one above the other. Those
    outside the cube are put on its surface.

    Parameters
    ----------
    place, array, acoustics
        The cube, what radiates, and through which air.
    step : float
        By how much the phase between two waves from the edges of the cone may change from a point to the next, in rad.
    """
    away = place.points[:, None, :] - array.position[None, :, :]
    axes, half = _cone((away / np.linalg.norm(away, axis=2, keepdims=True)).reshape(-1, 3))
    reach = place.reach
    # A cone of one transducer is a line: never further apart than the cube is wide.
    apart = np.minimum(step / np.maximum(wavenumber(array, acoustics.medium) * half, 1e-9), 2 * reach)
    count = np.ceil(reach * np.abs(axes).sum(axis=1) / apart).astype(int) + 1
    i, j, k = (each.ravel() for each in np.meshgrid(*[np.arange(-n, n + 1) for n in count], indexing="ij"))
    white = (i + j) % 2 == 0
    steps = np.stack([i, j, k + 0.5 * (i % 2)], axis=1)[white]
    free = steps * apart @ axes
    kept = np.clip(free, -reach, reach)
    moved = np.abs((kept - free) @ axes.T) / apart
    # Those that are moved by more than a prism and a half stand for nothing inside.
    kept = kept[(moved[:, 0] + moved[:, 1] <= 1.5) & (moved[:, 2] <= 0.8)]
    return np.unique(np.round(kept, 4), axis=0) + np.array(place.position)


def _cone(directions: Array) -> tuple[Array, Array]:
    """Axes, one a row, of the cone that directions make, the last one along it; and its half width along each."""
    along = directions.mean(axis=0)
    along /= np.linalg.norm(along)
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.linalg.norm(aside)
    across = np.cross(along, aside)
    # Turned until the cone is narrowest: a square array seen along its diagonal would seem twice as large.
    turned = [
        np.stack([np.cos(turn) * aside + np.sin(turn) * across, np.cos(turn) * across - np.sin(turn) * aside, along])
        for turn in np.radians(np.arange(0, 90, 7.5))
    ]
    widths = [np.ptp(directions @ axes.T, axis=0) / 2 for axes in turned]
    best = int(np.argmin([width[0] * width[1] for width in widths]))
    return turned[best], widths[best]
