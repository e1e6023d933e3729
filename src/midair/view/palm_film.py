"""A film of a palm: pressure on it and how its skin moves, moment by moment, wanted beside played."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.validation import frozen_array
from midair.view.film import Film, Tile
from midair.view.view_data import ViewData

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PalmMaps:
    """Maps of one quantity that share a scale.

    Attributes
    ----------
    maps : Mapping of str to ndarray, shape (frame, row, column)
        By what stands over each, in `unit`; either sign, NaN where there is no skin.
    unit : str
        Of the values.
    pitch : float
        Between the points, in m.
    square : tuple of float
        Half the sides of the square that the sensor covers, along x and y, in m.
    """

    maps: Mapping[str, Array]
    unit: str
    pitch: float
    square: tuple[float, float]

    def __post_init__(self) -> None:
        shape = ("frame", "row", "column")
        frozen = {name: frozen_array(each, name, shape, finite=False) for name, each in self.maps.items()}
        object.__setattr__(self, "maps", frozen)


def film_of_palm(
    groups: Sequence[PalmMaps], *, rate: float, title: str = "palm", simulated: bool = True, side: int = 256
) -> Film:
    """The film of these maps, all of as many frames.

    Parameters
    ----------
    groups : sequence of PalmMaps
        From left to right.
    rate : float
        Frames per second, in Hz.
    title : str
        What it is.
    simulated : bool
        Whether any of it was simulated.
    side : int
        Of each map, in pixels.
    """
    frames = min(len(each) for group in groups for each in group.maps.values())
    shown = ViewData(title=title, rate=rate, frames=frames, simulated=simulated)
    # Red pushes, blue lets go, white is still. What leaks may press many times harder than what is wanted: by roots
    # both are seen.
    return Film(shown, side=side, groups=[_tiles(group) for group in groups], table="RdBu_r")


def _tiles(group: PalmMaps) -> list[Tile]:
    top = max(float(np.nanmax(np.abs(each))) for each in group.maps.values())
    return [_tile(name, each, group, top) for name, each in group.maps.items()]


def _tile(name: str, frames: Array, group: PalmMaps, top: float) -> Tile:
    rows, columns = frames.shape[1:]
    side = max(rows, columns)
    above, left = (side - rows) // 2, (side - columns) // 2
    beside = ((above, side - rows - above), (left, side - columns - left))

    def values(frame: int) -> Array:
        roots = np.sign(frames[frame]) * np.sqrt(np.abs(frames[frame]) * top)
        # As wide as high, or it would be drawn out.
        return np.pad(roots, beside, constant_values=np.nan)

    unit, width = f"{group.unit},\nby roots", side * group.pitch
    return Tile(title=name, values=values, top=top, low=-top, unit=unit, width=width, square=group.square)
