"""A film of a palm: pressure and skin displacement over time, target and played."""

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
    """Maps of one quantity on one colour scale."""

    maps: Mapping[str, Array]
    """Signed values in `unit` by title, shape (frame, row, column); NaN where there is no skin."""
    unit: str
    pitch: float
    """Distance of the points in m."""
    square: tuple[float, float]
    """Half the sides (x, y) of the area that the sensor covers, in m."""

    def __post_init__(self) -> None:
        shape = ("frame", "row", "column")
        frozen = {name: frozen_array(each, name, shape, finite=False) for name, each in self.maps.items()}
        object.__setattr__(self, "maps", frozen)


def film_of_palm(
    groups: Sequence[PalmMaps], *, rate: float, title: str = "palm", simulated: bool = True, side: int = 256
) -> Film:
    """Make a film of maps that have the same number of frames.

    Parameters
    ----------
    groups : sequence of PalmMaps
        From left to right.
    rate : float
        Frame rate in Hz.
    side : int
        Side of each map in pixels.
    """
    frames = min(len(each) for group in groups for each in group.maps.values())
    shown = ViewData(title=title, rate=rate, frames=frames, simulated=simulated)
    # Red is positive, blue negative pressure. Leakage may be many times stronger than the target: on a square-root
    # scale both are visible.
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
        # Padded to a square, so that the map keeps its aspect ratio.
        return np.pad(roots, beside, constant_values=np.nan)

    unit, width = f"{group.unit},\nsquare root", side * group.pitch
    return Tile(title=name, values=values, top=top, low=-top, unit=unit, width=width, square=group.square)
