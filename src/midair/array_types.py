"""Types of NumPy arrays by the numbers that they hold."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Single = NDArray[np.float32]
