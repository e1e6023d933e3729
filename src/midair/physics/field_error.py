"""Relative error of a sound field, E (paper, 5.1)."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import ShapeError

Array = NDArray[np.float64]
Field = NDArray[np.complex128] | NDArray[np.float64]


def relative_error(field: Field, amplitude: Array) -> Array:
    """The paper's error of each frame, shape (frame,): ``E = || |G q| - p || / || p ||``.

    At the best phases u of the target, ``|| G q - diag(p) u || = || |G q| - p ||``, so this is the residual of eq. (5)
    over the target's norm. 0 where target and field are both silent; infinite where only the target is.

    Parameters
    ----------
    field : ndarray, shape (frame, point)
        G q, complex or its magnitude, peak, in Pa.
    amplitude : ndarray, shape (frame, point)
        Target p, peak, in Pa.
    """
    if np.shape(field) != np.shape(amplitude):
        raise ShapeError(f"field: expected the target's shape {np.shape(amplitude)}, got {np.shape(field)}")
    missed = np.linalg.norm(np.abs(field) - amplitude, axis=-1)
    wanted = np.linalg.norm(amplitude, axis=-1)
    unwanted = np.where(missed > 0, np.inf, 0.0)
    return np.divide(missed, wanted, out=unwanted, where=wanted > 0)


def printed_error(field: Field, amplitude: Array) -> Array:
    """The error as the paper prints it, (1/M) sqrt(||G q - p||^2 / ||p||^2), with M the number of points.

    The factor 1/M must be a misprint: with M = 256 an error of 10 % would be .04 %, and the paper reports 5 to 15 %.
    Use `relative_error`; this function exists so that both can be quoted.
    """
    return relative_error(field, amplitude) / np.shape(amplitude)[-1]
