"""A small set of points that represents a cube reached by sound from a narrow cone."""

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, TransducerArray
from midair.physics.exposure_places import Place
from midair.physics.propagation import wavenumber

Array = NDArray[np.float64]


def cone_points(place: Place, array: TransducerArray, acoustics: Acoustics, *, step: float) -> Array:
    """Points of a place's cube with the spacing at which the sound can change, shape (point, 3), in m.

    Across the cone they form a checkerboard, along it prisms. Points outside the cube are moved to its surface.

    Parameters
    ----------
    step : float
        Largest change, from a point to the next, of the phase between two waves from the edges of the cone, in rad.
    """
    away = place.points[:, None, :] - array.position[None, :, :]
    axes, half = _cone((away / np.linalg.norm(away, axis=2, keepdims=True)).reshape(-1, 3))
    reach = place.reach
    # The cone of one transducer is a line: limit the spacing to the width of the cube.
    apart = np.minimum(step / np.maximum(wavenumber(array, acoustics.medium) * half, 1e-9), 2 * reach)
    count = np.ceil(reach * np.abs(axes).sum(axis=1) / apart).astype(int) + 1
    i, j, k = (each.ravel() for each in np.meshgrid(*[np.arange(-n, n + 1) for n in count], indexing="ij"))
    white = (i + j) % 2 == 0
    steps = np.stack([i, j, k + 0.5 * (i % 2)], axis=1)[white]
    free = steps * apart @ axes
    kept = np.clip(free, -reach, reach)
    moved = np.abs((kept - free) @ axes.T) / apart
    # Points moved by more than one and a half prisms represent nothing inside.
    kept = kept[(moved[:, 0] + moved[:, 1] <= 1.5) & (moved[:, 2] <= 0.8)]
    return np.unique(np.round(kept, 4), axis=0) + np.array(place.position)


def _cone(directions: Array) -> tuple[Array, Array]:
    """Axes of the cone of these directions, one per row, the last one along it; and its half width along each."""
    along = directions.mean(axis=0)
    along /= np.linalg.norm(along)
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.linalg.norm(aside)
    across = np.cross(along, aside)
    # Rotate to the smallest width: a square array would seem twice as large along its diagonal.
    turned = [
        np.stack([np.cos(turn) * aside + np.sin(turn) * across, np.cos(turn) * across - np.sin(turn) * aside, along])
        for turn in np.radians(np.arange(0, 90, 7.5))
    ]
    widths = [np.ptp(directions @ axes.T, axis=0) / 2 for axes in turned]
    best = int(np.argmin([width[0] * width[1] for width in widths]))
    return turned[best], widths[best]
