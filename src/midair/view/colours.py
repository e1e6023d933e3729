"""Colour tables, loaded from Matplotlib on demand."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Table = Literal["inferno", "cividis", "twilight"]
TABLES: tuple[Table, ...] = ("inferno", "cividis", "twilight")
"""Two for magnitudes (zero is dark in inferno; cividis suits colour-blind people) and a cyclic one for phases."""


def colour_table(name: str) -> NDArray[np.uint8]:
    """Return 256 RGB colours from the lowest to the highest value, shape (256, 3)."""
    from matplotlib import colormaps

    return np.asarray(colormaps[name](np.arange(256) / 255, bytes=True)[:, :3], np.uint8)
