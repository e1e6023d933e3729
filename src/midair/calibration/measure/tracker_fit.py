"""Rotation and offset between a tracker and the array, from places that both measured (Kabsch 1976)."""

import numpy as np
from scipy.special import stdtrit

from midair.array_types import Array
from midair.errors import InputError
from midair.model import TrackerPlacement

LEAST_SPREAD = 0.02
"""Least standard deviation of the places at right angles to their longest extent, in m: below it they are collinear."""
LARGEST_SCATTER = 0.02
"""Largest scatter of a coordinate in m; above it the tracker followed something else."""


def fit_tracker(held: Array, places: Array) -> TrackerPlacement:
    """Placement of a tracker from 3 or more places, by least squares.

    The uncertainty follows from the scatter s of the coordinates, whose 3 n values have 3 n - 6 degrees of freedom:
    s sqrt(2 / n) for each coordinate of a placed point, on average over the places, times the ratio of Student's t to
    the normal distribution, so that twice the uncertainty covers 95 %.

    `held`, shape (place, 3), are the places by the tracker, and `places` the same ones in array coordinates, in m.
    Raises InputError if there are less than three, they are collinear, or they do not fit a rotation.
    """
    count = len(places)
    if count < 3 or held.shape != places.shape:
        raise InputError(f"tracker: expected 3 places or more, held as often as marked, got {len(held)} of {count}")
    for name, points in (("marked", places), ("held", held)):
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] / np.sqrt(count)
        if spread < LEAST_SPREAD:
            raise InputError(
                f"tracker: expected {name} places that are not in one line, got {1e3 * spread:.0f} mm beside it; "
                f"choose places {1e3 * LEAST_SPREAD:.0f} mm or more off the line"
            )
    left, _, right = np.linalg.svd((places - places.mean(axis=0)).T @ (held - held.mean(axis=0)))
    rotation = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    offset = places.mean(axis=0) - rotation @ held.mean(axis=0)
    freedom = 3 * count - 6
    scatter = float(np.sqrt((((held @ rotation.T + offset) - places) ** 2).sum() / freedom))
    if scatter > LARGEST_SCATTER:
        raise InputError(
            f"tracker: expected the held places to fit the marked ones, they scatter by {1e3 * scatter:.0f} mm; hold "
            "the palm where the focus is felt, and check the order of the places"
        )
    wider = stdtrit(freedom, 0.975) / 1.96
    return TrackerPlacement(rotation=rotation, offset=offset, uncertainty=scatter * np.sqrt(2 / count) * wider)
