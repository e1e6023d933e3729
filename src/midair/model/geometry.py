"""Positions of the transducers of arrays and of their units, the cells of the sensor and the control points.

Origin at the centre of the array, z towards the palm, metres. x increases with the column and y with the row of a grid;
maps are drawn with row 0 at the top, so that channel 0 is the top left corner, as in the paper's Fig. 4.
"""

import hashlib
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.model.provenance import Brief, clipped, counted, summary
from midair.validation import PITCHES, frozen_array, length, positive, within

HEIGHT = 0.2
"""Height of the palm or the sensor above the array, in m."""

HEIGHTS = (20e-3, 1.0)
"""Allowed heights, in m."""

BAND = (20.0, 470.0)
"""(low, high) of the frequency band that is reproduced, in Hz."""

RATE = 1000.0
"""Frame rate of sensors and drives in Hz."""


WIDEST = 1.0
"""Side of the largest square of control points in m, several palms."""

MOST_UNITS = 10_000
"""Largest number of AUTD3 units in an array: 2.5 million transducers, which take half a gigabyte."""

_UNKNOWN = np.zeros(0, np.complex128)
"""Response of transducers that have not been measured."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransducerArray:
    """The transducers of a phased array."""

    position: Array
    """Shape (transducer, 3), in m."""
    normal: Array
    """Unit vectors along which each transducer radiates, shape (transducer, 3)."""
    unit: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Index of the device that each transducer belongs to, from 0, shape (transducer,)."""
    pressure: float = 275.574246625 * 200e-3 / (4 * np.pi)
    """Peak sound pressure of one transducer on its axis at 1 m and full drive, times that distance, in Pa m.

    The default 4.38590 is that of the T4010A1 in the AUTD3 emulator; calibrate it on a real array."""
    frequency: float = 40e3
    """Frequency of the ultrasound, in Hz."""
    response: NDArray[np.complex128] = field(default_factory=lambda: _UNKNOWN)
    """Complex, shape (transducer,): measured pressure at full drive over `pressure` (`ArrayCalibration`); 1 by default.
    """
    pole: NDArray[np.complex128] = field(default_factory=lambda: _UNKNOWN)
    """Measured -1 / time constant + j (resonance - drive frequency), in rad/s, shape (transducer,); empty if not
    measured."""
    reflection: complex = 0.0
    """Reflection factor of the array's face for what a palm sends back, as far as a solver corrects its echo."""
    name: str = "array"
    """Name of the array in messages and files."""

    def __post_init__(self) -> None:
        position = frozen_array(self.position, "transducer position", ("transducer", 3))
        count = len(position)
        normal = frozen_array(self.normal, "transducer normal", (count, 3))
        if np.abs(np.linalg.norm(normal, axis=1) - 1).max() > 1e-6:
            raise InputError("transducer normal: expected unit vectors; divide each by its length")
        unit = self.unit if len(self.unit) else np.zeros(count, np.int64)
        within(np.abs(position).max(), "transducer position", 0, 20, unit="m")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "normal", normal)
        object.__setattr__(self, "unit", frozen_array(unit, "transducer unit", (count,), np.int64))
        response = self.response if len(self.response) else np.ones(count)
        object.__setattr__(self, "response", frozen_array(response, "transducer response", (count,), np.complex128))
        poles = (count if len(self.pole) else 0,)
        object.__setattr__(self, "pole", frozen_array(self.pole, "transducer pole", poles, np.complex128))
        positive(self.pressure, "pressure of one transducer", "Pa m")
        positive(self.frequency, "frequency of the ultrasound", "Hz")
        within(abs(self.reflection), "reflection factor of the array's face", 0, 1)

    def __repr__(self) -> str:
        units = len(np.unique(self.unit))
        width, depth = 1e3 * np.ptp(self.position[:, :2], axis=0)
        return summary(
            self,
            clipped(self.name),
            f"{counted(self.count, 'transducer')} in {counted(units, 'unit')}",
            f"{width:.3g} x {depth:.3g} mm",
            f"{self.frequency / 1e3:g} kHz",
            f"{self.pressure:.3g} Pa m each",
        )

    @classmethod
    def autd3(cls, *, columns: int = 2, rows: int = 2) -> "TransducerArray":
        """`columns` by `rows` AUTD3 units side by side: 249 transducers each, in the order of the firmware.

        A unit is an 18 x 14 grid of 10.16 mm pitch without (1, 1), (2, 1) and (16, 1), row by row; units are 192.0 x
        151.4 mm apart. The array is centred on the mean of its positions.
        """
        if min(columns, rows) < 1:
            raise InputError(f"units: expected at least 1 x 1, got {columns} x {rows}")
        if columns * rows > MOST_UNITS:
            raise InputError(f"units: expected at most {MOST_UNITS} in an array, got {columns} x {rows}")
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
        """True if no transducer has a measured response."""
        return bool((self.response == 1).all()) and not len(self.pole)

    @property
    def calibration_id(self) -> str:
        """Identifier of the array calibration that the response and the poles are from; empty if not measured."""
        if not len(self.pole):
            return ""
        return hashlib.sha256(self.response.tobytes() + self.pole.tobytes()).hexdigest()[:8]

    @property
    def nominal(self) -> "TransducerArray":
        """The same array without its measured response and reflection."""
        known = self.reflection or not self.alike
        return replace(self, response=_UNKNOWN, pole=_UNKNOWN, reflection=0.0) if known else self

    def same_as(self, other: "TransducerArray") -> bool:
        """True if phases for one array fit the other: equal positions (to 1 µm), normals and frequency."""
        return (
            self.count == other.count
            and self.frequency == other.frequency
            and np.abs(self.position - other.position).max() < 1e-6
            and np.abs(self.normal - other.normal).max() < 1e-6
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Points in rows and columns with a constant pitch: the base of sensor and control grids."""

    rows: int
    columns: int
    pitch: float
    """Distance between neighbours, in m."""

    def __post_init__(self) -> None:
        if min(self.rows, self.columns) < 1:
            raise ShapeError(f"grid: expected at least 1 row and 1 column, got {self.rows} x {self.columns}")
        length(self.pitch, "pitch", PITCHES)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.rows, self.columns

    @property
    def count(self) -> int:
        """Number of channels or control points."""
        return self.rows * self.columns

    @property
    def x(self) -> Array:
        """Position of each column relative to the centre of the grid, shape (column,), in m."""
        return centred(self.columns, self.pitch)

    @property
    def y(self) -> Array:
        """Position of each row relative to the centre of the grid, shape (row,), in m."""
        return centred(self.rows, self.pitch)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorGrid(Grid):
    """A square grid of pressure cells: channel = row * columns + column."""

    rows: int = 4
    columns: int = 4
    pitch: float = 11e-3
    name: str = "sensor"
    """Name of the sensor; a calibration fits only the sensor of its name."""

    def __repr__(self) -> str:
        return summary(self, self.spelled, f"{1e3 * self.pitch:.4g} mm apart")

    @property
    def spelled(self) -> str:
        """Rows, columns and the name on one short line: ``4 x 4 'sensor'``."""
        return f"{self.rows} x {self.columns} '{clipped(self.name)}'"

    def channel_position(self, channel: int) -> tuple[float, float]:
        """(x, y) of a channel relative to the centre of the grid, in m."""
        if not 0 <= channel < self.count:
            raise ShapeError(f"channel: expected 0 to {self.count - 1}, got {channel}")
        row, column = divmod(channel, self.columns)
        return float(self.x[column]), float(self.y[row])


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlGrid(Grid):
    """Control points in midair, where sound pressure is prescribed: a square grid parallel to the array."""

    rows: int = 16
    columns: int = 16
    pitch: float = 11e-3 / 3
    height: float = HEIGHT
    """Height above the array, in m."""
    centre: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the centre of the grid, in m."""

    def __post_init__(self) -> None:
        Grid.__post_init__(self)
        length(self.height, "height", HEIGHTS)
        if self.count * self.pitch**2 > WIDEST**2:
            wide, deep, most = self.columns * self.pitch, self.rows * self.pitch, int(WIDEST / self.pitch)
            raise InputError(
                f"points: expected control points over at most {WIDEST:g} x {WIDEST:g} m, got {self.columns} x "
                f"{self.rows} of {1e3 * self.pitch:.3g} mm pitch, {wide:.3g} x {deep:.3g} m; use at most {most} x "
                f"{most}, or a smaller pitch"
            )
        centre = frozen_array(self.centre, "centre", (2,))
        object.__setattr__(self, "centre", tuple(length(each, "centre", (-WIDEST, WIDEST)) for each in centre))

    @property
    def position(self) -> Array:
        """Position of each point, row by row, shape (point, 3), in m."""
        x, y = np.meshgrid(self.x + self.centre[0], self.y + self.centre[1])
        return np.stack([x.ravel(), y.ravel(), np.full(self.count, self.height)], axis=1)


def centred(count: int, pitch: float) -> Array:
    """`count` positions `pitch` apart around 0, shape (count,), in m."""
    return np.asarray((np.arange(count) - (count - 1) / 2) * pitch, np.float64)


UNIT = TransducerArray.autd3(columns=1, rows=1).count
"""Number of transducers of one unit."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Placement(Brief):
    """Position and rotation of each unit."""

    position: Array
    """Position of each unit's first transducer, shape (unit, 3), in m."""
    rotation: Array
    """Rotation about the fixed x, then y, then z axis, shape (unit, 3), in rad."""
    name: str = "AUTD3"
    """Name of the array."""

    def __post_init__(self) -> None:
        position = frozen_array(self.position, "unit position", ("unit", 3))
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "rotation", frozen_array(self.rotation, "unit rotation", (len(position), 3)))

    @classmethod
    def grid(cls, *, columns: int = 2, rows: int = 2) -> "Placement":
        """Units side by side in one plane, 192.0 x 151.4 mm apart, row by row."""
        if columns < 1 or rows < 1:
            raise InputError(f"units: expected at least 1 x 1, got {columns} x {rows}")
        corners = np.array([(i * 192.0e-3, j * 151.4e-3, 0.0) for j in range(rows) for i in range(columns)])
        return cls(position=corners, rotation=np.zeros_like(corners), name=f"AUTD3 {columns} x {rows}")

    @property
    def units(self) -> int:
        """Number of units."""
        return len(self.position)

    @property
    def quaternion(self) -> Array:
        """Rotation of each unit as a quaternion (w, x, y, z), the order of both SDKs, shape (unit, 4)."""
        # The product of those about z, y and x. SciPy has it too, but its import takes a quarter of a second.
        (a, b, c), (x, y, z) = np.cos(self.rotation.T / 2), np.sin(self.rotation.T / 2)
        turns = (a * b * c + x * y * z, x * b * c - a * y * z, a * y * c + x * b * z, a * b * z - x * y * c)
        return np.stack(turns, axis=1)

    @property
    def origin(self) -> Array:
        """Position of each unit's first transducer in the centred array, shape (unit, 3), in m."""
        return self.position - self._transducers().mean(axis=(0, 1))

    def array(self) -> TransducerArray:
        """The transducers, unit by unit, in the order of the firmware."""
        position = self._transducers()
        normal = self._turned(np.array([[0.0, 0.0, 1.0]]))
        return TransducerArray(
            position=(position - position.mean(axis=(0, 1))).reshape(-1, 3),
            normal=np.repeat(normal, position.shape[1], axis=0).reshape(-1, 3),
            unit=np.repeat(np.arange(self.units), position.shape[1]),
            name=self.name,
        )

    def _transducers(self) -> Array:
        one = TransducerArray.autd3(columns=1, rows=1).position
        return self._turned(one - one[0]) + self.position[:, None]

    def _turned(self, points: Array) -> Array:
        w, axis = np.split(self.quaternion[:, None], [1], axis=2)
        across = 2 * np.cross(axis, points)
        return points + w * across + np.cross(axis, across)
