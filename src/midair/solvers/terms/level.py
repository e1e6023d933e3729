"""The lowest drive level that suffices for the loudest target of a recording.

The error depends on the strength of the target over the level. If it is small, the array's power goes to places outside
the target; if it is large, the target cannot be reached.
"""

import numpy as np
from numpy.typing import NDArray


def automatic_level(amplitude: NDArray[np.float64], *, strength: float = 0.1, lowest: float = 0.05) -> float:
    """Level at which the loudest target, in units of the focus, has this strength; between `lowest` and 1.

    E hardly grows up to strength .1, and fast above. Below `lowest` an 8-bit intensity has hardly a dozen steps.
    """
    return float(np.clip(amplitude.max() / strength, lowest, 1.0))
