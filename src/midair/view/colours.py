"""Colour tables, from Matplotlib when they are asked for."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Table = Literal["inferno", "cividis", "twilight"]
TABLES: tuple[Table, ...] = ("inferno", "cividis", "twilight")
"""For magnitudes (the zero of inferno is the ground; cividis for people who see no red or green), and for phases."""


def colour_table(name: str) -> NDArray[np.uint8]:
    """256 colours from the lowest value to the highest, shape (256, 3): red, green, blue."""
    from matplotlib import colormaps

    return np.asarray(colormaps[name](np.arange(256) / 255, bytes=True)[:, :3], np.uint8)
