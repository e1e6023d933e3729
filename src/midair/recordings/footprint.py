"""Turn a recording of one channel into a pressure field: a contact patch with that waveform moves over the sensor.

Most libraries of touch signals hold one waveform per surface, without position and size of the contact. These are
parameters here: a footprint of given shape and size moves over the cells at a given speed along a given path, and the
pressure everywhere inside it follows the waveform. Each cell measures the mean over its own square,

    p_cell(t) = w(t) A(footprint at t, cell) / A(cell),

with the exact overlap area A (closed forms below), so that the total force is w(t) times the area of the footprint on
the sensor. The speed moves the footprint but does not stretch the waveform: the spectrum at another speed differs, and
needs a new recording.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.model import Recording, SensorGrid, Setting
from midair.validation import length, one_of, within

Shape = Literal["circle", "square", "line"]
"""Disc of diameter `size`, square of side `size` parallel to the cells, or long bar of width `size` across the path."""

Path = Literal["x", "y", "diagonal", "circle"]
"""Through the centre of the sensor along columns, rows, or both at 45 degrees; or round it at a quarter of its side."""

Turn = Literal["stop", "back", "again"]
"""After the footprint has left the sensor it stops, moves back, or starts again from the first side."""

FASTEST = 10.0
"""Greatest speed of a footprint in m/s, far above that of a hand."""

_DIRECTION = {"x": (1.0, 0.0), "y": (0.0, 1.0), "diagonal": (np.sqrt(0.5), np.sqrt(0.5)), "circle": (1.0, 0.0)}
_BLOCK = 1 << 16  # frames per block, to bound the memory


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprint:
    """Shape and motion of a contact patch."""

    shape: Shape = "circle"
    size: float = 20e-3
    """Diameter, side or width, in m."""
    speed: float = 50e-3
    """In m/s; negative to start from the other side; 0 for a patch that stays over the centre of the sensor."""
    path: Path = "x"
    turn: Turn = "stop"

    def __post_init__(self) -> None:
        for name, known in (("shape", Shape), ("path", Path), ("turn", Turn)):
            one_of(getattr(self, name), known, f"footprint, {name}")
        length(self.size, "size of the footprint", (1e-6, 1.0))
        within(self.speed, "speed of the footprint", -FASTEST, FASTEST, unit="m/s", advice="give mm/s")
        if self.path == "circle" and self.shape == "line":
            raise InputError("path of the footprint: expected x, y or diagonal for a line, got circle")

    def reach(self, sensor: SensorGrid) -> float:
        """Distance from the centre of the sensor from which the footprint does not touch it, in m.

        The support function of both, which a square sensor is left at; another one may be left a little earlier.
        """
        x, y = _DIRECTION[self.path]
        half = self.size / 2 * (x + y if self.shape == "square" else 1.0)
        return float(x * sensor.columns + y * sensor.rows) * sensor.pitch / 2 + half

    def crossing(self, sensor: SensorGrid) -> float:
        """Time from the first contact to the last, in s; infinite at speed 0 and on a circle."""
        return 2 * self.reach(sensor) / abs(self.speed) if self.speed and self.path != "circle" else np.inf

    def centre(self, time: Array, sensor: SensorGrid) -> Array:
        """Centre of the footprint at each time, shape (time, 2): x and y from the centre of the sensor, in m."""
        if self.path == "circle" and self.speed:
            radius = min(sensor.shape) * sensor.pitch / 4
            angle = self.speed / radius * np.asarray(time, float)
            return radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        reach, way = self.reach(sensor), abs(self.speed) * np.asarray(time, float)
        if self.turn == "again":
            way = way % (2 * reach)
        elif self.turn == "back":
            way = 2 * reach - np.abs(way % (4 * reach) - 2 * reach)
        along = (way - reach) * np.sign(self.speed) if self.speed else np.zeros_like(way)
        return np.multiply.outer(along, _DIRECTION[self.path])


def footprint_field(recording: Recording, footprint: Footprint, sensor: SensorGrid | None = None) -> Recording:
    """The pressure field of a footprint that presses on a sensor with a waveform of one channel.

    The result is marked as simulated, because its positions were not measured; it is lazy if the samples are. Its unit
    is that of the waveform: Pa, or the output of a sensor of that shape. At time 0 the footprint is about to touch the
    first side of `sensor`, the paper's 4 x 4 at 11 mm if None. Raises ShapeError if the recording has more than one
    channel.
    """
    sensor = sensor or SensorGrid()
    if recording.sensor.count != 1:
        raise ShapeError(
            f"footprint: expected a recording of one channel, got {recording.sensor.count}",
            parameters={"channels": "channels=(...) to choose one"},
        )

    settings: dict[str, Setting] = {
        "field": "synthetic: one waveform times the share of each cell that the footprint covers",
        "shape": footprint.shape,
        "size_m": footprint.size,
        "speed_m_per_s": footprint.speed,
        "path": footprint.path,
        "turn": footprint.turn,
        "rows": sensor.rows,
        "columns": sensor.columns,
        "pitch_m": sensor.pitch,
    }
    provenance = recording.provenance.then("footprint", settings, simulated=True)
    samples = recording.samples * covered(footprint, sensor, recording.time)
    return replace(recording, samples=samples, sensor=sensor, provenance=provenance)


def covered(footprint: Footprint, sensor: SensorGrid, time: Array) -> Array:
    """Share of each cell that the footprint covers at each time (s), shape (time, row, column), 0 to 1."""
    share = np.empty((len(time), *sensor.shape))
    for first in range(0, len(time), _BLOCK):
        part = slice(first, first + _BLOCK)
        share[part] = _area(footprint, sensor, footprint.centre(time[part], sensor)) / sensor.pitch**2
    # Differences of areas leave rounding errors on cells that are not covered.
    return np.clip(np.where(share < 1e-12, 0.0, share), 0.0, 1.0)


def _area(footprint: Footprint, sensor: SensorGrid, centre: Array) -> Array:
    """Area of each cell under the footprint in m2; broadcasts to (time, row, column)."""
    half = sensor.pitch / 2
    x = sensor.x[None, None, :] - centre[:, 0, None, None]
    y = sensor.y[None, :, None] - centre[:, 1, None, None]
    if footprint.shape == "square":
        return _overlap(x, half, footprint.size / 2) * _overlap(y, half, footprint.size / 2)
    if footprint.shape == "circle":
        return disc_in_rectangle(x - half, x + half, y - half, y + half, footprint.size / 2)
    along = x * _DIRECTION[footprint.path][0] + y * _DIRECTION[footprint.path][1]
    return _strip_in_square(along, sensor.pitch, footprint.size / 2, diagonal=footprint.path == "diagonal")


def disc_in_rectangle(left: Array, right: Array, low: Array, high: Array, radius: float) -> Array:
    """Area of a disc of `radius` around 0 in a rectangle, in m2, by inclusion and exclusion of the corners."""
    corner = [_disc_below(x / radius, y / radius) for x in (left, right) for y in (low, high)]
    return radius**2 * (corner[3] - corner[2] - corner[1] + corner[0])


def _disc_below(x: Array, y: Array) -> Array:
    """Area of the unit disc with X <= x and Y <= y: the integral of the chords at t from -1 to x below y."""
    # A chord from -s to s, s = sqrt(1 - t^2), counts y + s where |t| < c; elsewhere 2 s for y above 0, and 0 below.
    x, y = np.broadcast_arrays(np.clip(x, -1, 1), np.clip(y, -1, 1))
    c = np.sqrt(1 - y * y)
    inner = np.clip(x, -c, c)
    inside = _half_chord(inner) - _half_chord(-c)
    return y * (inner + c) + inside + np.where(y > 0, 2 * (_half_chord(x) - _half_chord(-1.0) - inside), 0.0)


def _half_chord(t: Array | float) -> Array:
    """Integral of sqrt(1 - t^2)."""
    return (t * np.sqrt(1 - np.square(t)) + np.arcsin(t)) / 2


def _overlap(distance: Array, half: float, other: float) -> Array:
    """Length of the overlap of two intervals of half lengths `half` and `other` whose centres are `distance` apart."""
    return np.clip(half + other - np.abs(distance), 0.0, 2 * min(half, other))


def _strip_in_square(along: Array, pitch: float, half: float, *, diagonal: bool) -> Array:
    """Area of a square of side `pitch` within `half` of a line, parallel or at 45 degrees, `along` from its centre."""
    if not diagonal:
        return _overlap(along, pitch / 2, half) * pitch
    return _square_below(half - along, pitch) - _square_below(-half - along, pitch)


def _square_below(reach: Array, pitch: float) -> Array:
    """Area of a square of side `pitch` around 0 below a line at 45 degrees, `reach` from its centre."""
    corner = pitch * np.sqrt(0.5)
    d = np.clip(reach, -corner, corner)
    return np.where(d < 0, (corner + d) ** 2, pitch**2 - (corner - d) ** 2)
