"""Where things are: the transducers of the array, the cells of the sensor, the points that are controlled.

Origin at the centre of the array, z towards the palm, metres. x grows with the column and y with the row of a grid;
maps are drawn with row 0 at the top, so that channel 0 is the top left corner, as in the paper's Fig. 4.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model.pictures import dots, framed
from midair.model.reprs import clipped, counted, told
from midair.validation import HEIGHTS, PITCHES, frozen_array, length, positive

Array = NDArray[np.float64]
_UNKNOWN = np.zeros(0, np.complex128)
"""Of transducers that nobody measured."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransducerArray:
    """The transducers of a phased array.

    Attributes
    ----------
    position : ndarray, shape (transducer, 3)
        In m.
    normal : ndarray, shape (transducer, 3)
        Unit vectors along which each transducer radiates.
    unit : ndarray of int, shape (transducer,)
        Which device of the array a transducer belongs to, from 0.
    pressure : float
        Peak sound pressure of one transducer on its axis at 1 m and full drive, times that distance, in Pa m.
        4.38590 is the T4010A1's value in the AUTD3 emulator; on a real array it is a parameter to calibrate.
    frequency : float
        Of the ultrasound, in Hz.
    response : ndarray of complex, shape (transducer,)
        What each one radiates under full drive, over what `pressure` says, where it was measured
        (`ArrayCalibration`); empty for 1 everywhere.
    pole : ndarray of complex, shape (transducer,)
        -1 / time constant + j (resonance less drive) of each, in rad/s, where it was measured; empty elsewhere.
    name : str
        What to call the array in messages and files.
    """

    position: Array
    normal: Array
    unit: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    pressure: float = 275.574246625 * 200e-3 / (4 * np.pi)
    frequency: float = 40e3
    response: NDArray[np.complex128] = field(default_factory=lambda: _UNKNOWN)
    pole: NDArray[np.complex128] = field(default_factory=lambda: _UNKNOWN)
    name: str = "array"

    def __post_init__(self) -> None:
        position = frozen_array(self.position, "transducer position", ("transducer", 3))
        count = len(position)
        normal = frozen_array(self.normal, "transducer normal", (count, 3))
        if np.abs(np.linalg.norm(normal, axis=1) - 1).max() > 1e-6:
            raise InputError("transducer normal: expected unit vectors; divide each by its length")
        unit = self.unit if len(self.unit) else np.zeros(count, np.int64)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "normal", normal)
        object.__setattr__(self, "unit", frozen_array(unit, "transducer unit", (count,), np.int64))
        response = self.response if len(self.response) else np.ones(count)
        object.__setattr__(self, "response", frozen_array(response, "transducer response", (count,), np.complex128))
        poles = (count if len(self.pole) else 0,)
        object.__setattr__(self, "pole", frozen_array(self.pole, "transducer pole", poles, np.complex128))
        positive(self.pressure, "pressure of one transducer", "Pa m")
        positive(self.frequency, "frequency of the ultrasound", "Hz")

    def __repr__(self) -> str:
        units = len(np.unique(self.unit))
        width, depth = 1e3 * np.ptp(self.position[:, :2], axis=0)
        return told(
            self,
            clipped(self.name),
            f"{counted(self.count, 'transducer')} in {counted(units, 'unit')}",
            f"{width:.3g} x {depth:.3g} mm",
            f"{self.frequency / 1e3:g} kHz",
            f"{self.pressure:.3g} Pa m each",
        )

    def _repr_html_(self) -> str:
        # Neighbours among the 16 colours look alike: steps of 5 keep units apart that stand side by side.
        picture = dots(self.position, np.asarray(self.unit * 5 % 16, np.int64))
        return framed(self, picture, "Transducers from above, coloured by unit; x, y in mm")

    @classmethod
    def autd3(cls, *, columns: int = 2, rows: int = 2) -> "TransducerArray":
        """`columns` by `rows` AUTD3 units side by side: 249 transducers each, in the order of the firmware.

        A unit is an 18 x 14 grid of 10.16 mm pitch without (1, 1), (2, 1) and (16, 1), row by row; units are
        192.0 x 151.4 mm apart. The array is centred on the mean of its positions.
        """
        if columns < 1 or rows < 1:
            raise InputError(f"units: expected at least 1 x 1, got {columns} x {rows}")
        pitch, width, depth, screws = 10.16e-3, 192.0e-3, 151.4e-3, {(1, 1), (2, 1), (16, 1)}
        one = np.array([(x * pitch, y * pitch, 0.0) for y in range(14) for x in range(18) if (x, y) not in screws])
        corners = [(i * width, j * depth, 0.0) for j in range(rows) for i in range(columns)]
        position = np.concatenate([one + corner for corner in corners])
        position -= position.mean(axis=0)
        return cls(
            position=position,
            normal=np.broadcast_to([0.0, 0.0, 1.0], position.shape),
            unit=np.repeat(np.arange(columns * rows), len(one)),
            name=f"AUTD3 {columns} x {rows}",
        )

    @property
    def count(self) -> int:
        """Number of transducers."""
        return len(self.position)

    @property
    def alike(self) -> bool:
        """Whether all transducers are taken for what the model says: nobody has measured them."""
        return bool((self.response == 1).all()) and not len(self.pole)

    @property
    def nominal(self) -> "TransducerArray":
        """The same without what was measured of it."""
        return self if self.alike else replace(self, response=_UNKNOWN, pole=_UNKNOWN)

    def same_as(self, other: "TransducerArray") -> bool:
        """Whether phases made for one are right for the other: same places, normals and frequency, to 1 µm."""
        return (
            self.count == other.count
            and self.frequency == other.frequency
            and np.abs(self.position - other.position).max() < 1e-6
            and np.abs(self.normal - other.normal).max() < 1e-6
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Places in rows and columns, the same distance apart: what sensors and control grids share.

    Attributes
    ----------
    rows, columns : int
        Number of places.
    pitch : float
        Distance between neighbours, in m.
    """

    rows: int
    columns: int
    pitch: float

    def __post_init__(self) -> None:
        # NaN and infinity are no whole numbers either.
        if not all(count >= 1 and count % 1 == 0 for count in (self.rows, self.columns)):
            raise ShapeError(f"grid: expected at least 1 row and 1 column, got {self.rows} x {self.columns}")
        length(self.pitch, "pitch", PITCHES)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.rows, self.columns

    @property
    def count(self) -> int:
        """Number of places: channels, or control points."""
        return self.rows * self.columns

    @property
    def x(self) -> Array:
        """Of each column, from the middle of the grid, shape (column,), in m."""
        return centred(self.columns, self.pitch)

    @property
    def y(self) -> Array:
        """Of each row, from the middle of the grid, shape (row,), in m."""
        return centred(self.rows, self.pitch)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorGrid(Grid):
    """A square grid of pressure cells: channel = row * columns + column.

    Attributes
    ----------
    rows, columns : int
        Number of cells.
    pitch : float
        Distance between neighbours, in m.
    name : str
        Which sensor it is; a calibration fits only the sensor it was made with.
    """

    rows: int = 4
    columns: int = 4
    pitch: float = 11e-3
    name: str = "sensor"

    def __repr__(self) -> str:
        return told(self, self.spelled, f"{1e3 * self.pitch:.4g} mm apart")

    @property
    def spelled(self) -> str:
        """``4 x 4 'sensor'``: rows, columns and the name on one short line."""
        return f"{self.rows} x {self.columns} '{clipped(self.name)}'"

    def channel_position(self, channel: int) -> tuple[float, float]:
        """(x, y) of a channel from the centre of the grid, in m."""
        if not 0 <= channel < self.count:
            raise ShapeError(f"channel: expected 0 to {self.count - 1}, got {channel}")
        row, column = divmod(channel, self.columns)
        return float(self.x[column]), float(self.y[row])


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlGrid(Grid):
    """The points in midair whose sound pressure is controlled: a square grid parallel to the array.

    Attributes
    ----------
    rows, columns : int
        Number of points.
    pitch : float
        Distance between neighbours, in m.
    height : float
        Above the array, in m.
    centre : tuple of float
        (x, y) of the middle of the grid, in m.
    """

    rows: int = 16
    columns: int = 16
    pitch: float = 11e-3 / 3
    height: float = 0.2
    centre: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        Grid.__post_init__(self)
        length(self.height, "height", HEIGHTS)
        object.__setattr__(self, "centre", (float(self.centre[0]), float(self.centre[1])))

    @property
    def position(self) -> Array:
        """Of each point, row by row, shape (point, 3), in m."""
        x, y = np.meshgrid(self.x + self.centre[0], self.y + self.centre[1])
        return np.stack([x.ravel(), y.ravel(), np.full(self.count, self.height)], axis=1)


def centred(count: int, pitch: float) -> Array:
    """`count` places `pitch` apart around 0, shape (count,), in m."""
    return np.asarray((np.arange(count) - (count - 1) / 2) * pitch, np.float64)
