"""How loud the array is to be for a recording: as loud as its peak needs, and no louder.

An array at full drive that is asked for little must put its power somewhere else. What counts is the strength of the
target over the level: the smaller, the more of the sound goes where nobody asked for it; the larger, the less can be
met.
"""

import numpy as np
from numpy.typing import NDArray


def automatic_level(amplitude: NDArray[np.float64], *, strength: float = 0.1, lowest: float = 0.05) -> float:
    """Level at which the loudest target of a recording has the given strength; between `lowest` and 1.

    Parameters
    ----------
    amplitude : ndarray, shape (frame, point)
        Targets, in units of the focus of the whole array at full drive.
    strength : float
        Strength of the loudest target over the level. E hardly grows up to .1, and fast beyond it.
    lowest : float
        Below it an 8-bit intensity has hardly a dozen steps.
    """
    return float(np.clip(amplitude.max() / strength, lowest, 1.0))
