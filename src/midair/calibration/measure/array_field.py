"""Phase codes that let a sensor measure each transducer of an array beside a steady focused beam, and their model.

A sensor measures radiation pressure, which grows with the square of the sound, so a single transducer is far too weak.
The square of a strong steady sound plus a weak changing one changes by 2 Re(conj(strong) weak), the product of both. So
all transducers hold a focus on some cells, and those of one group at a time are shifted by +90, -90 or 0 degrees by a
random code for each transducer. The component in phase with the beam gives the strength of a transducer, the component
in quadrature its phase error. Random codes of length L are orthogonal to 1 / sqrt(L). The transient after each step of
a code gives the resonance and the time constant.

The forward model of `array_fit` has transducer dynamics, pressure averaged over cells, and channel responses, with the
derivatives with respect to every unknown.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError, ShapeError
from midair.model import BAND, HEIGHT, RATE, Acoustics, Calibration, ControlGrid, SensorGrid, TransducerArray
from midair.physics import (
    ArrayKey,
    SensorModel,
    cell_weights,
    palm_echo,
    quantise_phase,
    radiation_pressure,
    transfer_matrix,
)
from midair.validation import positive, within


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayPlan:
    """Settings of the phase codes for an array, which are played group by group."""

    duration: float = 8.0
    """Duration of all codes together in s; the uncertainties fall with its square root."""
    group: int = 250
    """Approximate number of transducers per group."""
    top: float = 100.0
    """Highest pressure of the steady beam on any of its cells, in Pa."""
    settle: float = 0.15
    """Pause between two groups in s: twice the memory of a sensor that responds to changes only."""
    rate: float = RATE
    """Frame rate of the drive in Hz."""
    seed: int = 0
    """Random seed of groups and codes."""

    def __post_init__(self) -> None:
        for name, unit in (("duration", "s"), ("top", "Pa"), ("settle", "s"), ("rate", "Hz")):
            positive(getattr(self, name), f"{name} of the codes", unit)
        within(self.group, "group of transducers", 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayCodes:
    """Phase codes of all groups, and the steady beam."""

    rate: float
    """Frame rate in Hz."""
    still: Array
    """Phases of the steady beam in rad, shape (transducer,)."""
    level: float
    """Drive level of all transducers, 0 to 1."""
    groups: tuple[NDArray[np.int64], ...]
    """Transducer numbers of each group."""
    codes: tuple[NDArray[np.int8], ...]
    """Quarter turns from the beam's phase (-1, 0, 1) per group, shape (frame, transducer of the group)."""
    settle: int
    """Frames between two groups and after the last; twice as many before the first."""
    cells: tuple[int, ...]
    """Channels under the beam."""

    @property
    def starts(self) -> tuple[int, ...]:
        """First coded frame of each group."""
        lengths = np.array([len(code) + self.settle for code in self.codes])
        return tuple(int(first) for first in 2 * self.settle + np.cumsum(lengths) - lengths)

    @property
    def frames(self) -> int:
        """Number of frames of all groups and pauses."""
        return 2 * self.settle + sum(len(code) + self.settle for code in self.codes)

    @property
    def phase(self) -> Array:
        """Phase of every frame in rad, shape (frame, transducer)."""
        phase = np.tile(self.still, (self.frames, 1))
        for first, group, code in zip(self.starts, self.groups, self.codes, strict=True):
            phase[first : first + len(code), group] += code * (np.pi / 2)
        return phase


def array_codes(
    array: TransducerArray, sensor: SensorGrid, plan: ArrayPlan, *, acoustics: Acoustics, height: float
) -> ArrayCodes:
    """Generate the codes of a plan for an array with a sensor over its centre.

    `array` is the nominal one, and the sensor lies at `height` in m above it. Raises InputError if there are fewer than
    twice as many measured numbers as unknowns in a group.
    """
    rng = np.random.default_rng(plan.seed)
    count = max(1, round(array.count / plan.group))
    groups = tuple(np.sort(part) for part in np.array_split(rng.permutation(array.count), count))
    frames = round(plan.duration * plan.rate / count)
    # The channels in the middle of the sensor: one or two along each axis.
    rows, columns = ({(size - 1) // 2, size // 2} for size in sensor.shape)
    cells = tuple(sorted(row * sensor.columns + column for row in rows for column in columns))
    # Each transducer has two unknowns of the response and two of the pole; each frame and cell gives one number.
    least = round(2 * 4 * len(groups[0]) / len(cells))
    if frames < least:
        raise InputError(
            f"duration of the codes: expected {least * count / plan.rate:.3g} s or more for {array.count} transducers, "
            f"got {plan.duration:g} s"
        )
    codes = tuple(rng.choice(np.array([-1, 0, 0, 1], np.int8), (frames, len(group))) for group in groups)
    still, level = _beam(array, sensor, cells, plan, acoustics, height)
    return ArrayCodes(
        rate=plan.rate,
        still=still,
        level=level,
        groups=groups,
        codes=codes,
        settle=round(plan.settle * plan.rate),
        cells=cells,
    )


def _beam(
    array: TransducerArray,
    sensor: SensorGrid,
    cells: tuple[int, ...],
    plan: ArrayPlan,
    acoustics: Acoustics,
    height: float,
) -> tuple[Array, float]:
    """Phases with 8-bit steps for equal pressure on some cells, and the level for the plan's highest pressure."""
    foci = np.array([(*sensor.channel_position(cell), height) for cell in cells])
    G = transfer_matrix(foci, array, acoustics=acoustics)
    wanted = np.ones(len(cells), complex)
    q = np.exp(1j * np.angle(G.conj().T @ wanted))
    for _ in range(50):
        # Gerchberg-Saxton: equal amplitudes of the transducers, equal pressures on the cells.
        reached = G @ q
        wanted = np.abs(wanted) * np.abs(reached).mean() / np.abs(reached) * np.exp(1j * np.angle(reached))
        q = np.exp(1j * np.angle(G.conj().T @ wanted))
    phase = quantise_phase(np.angle(q))
    strongest = radiation_pressure(np.abs(G @ np.exp(1j * phase)), acoustics.medium).max()
    return phase, min(1.0, float(np.sqrt(plan.top / strongest)))


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorPlace:
    """Position of the sensor, and other parameters that all transducers share."""

    x: float = 0.0
    y: float = 0.0
    z: float = HEIGHT
    """Height of the sensor's centre above the array in m; x and y are its other coordinates."""
    turn: float = 0.0
    """Rotation about the vertical axis in rad."""
    late: float = 0.0
    """Delay of the array after the first frame of the recording, in s."""
    gain: float = 1.0
    """Pressure relative to the model."""
    spread: float = 1e-3
    """Standard deviation of the gel's point spread, in m."""
    echo: float = 0.0
    """Real part of the reflection factor of the array's face."""
    echo_imag: float = 0.0
    """Its imaginary part."""

    @property
    def reflection(self) -> complex:
        """Reflection factor of the array's face."""
        return complex(self.echo, self.echo_imag)


def placed(flat: Array, place: SensorPlace) -> Array:
    """Positions in m above the array, shape (point, 3), of points (point, 2) of the sensor."""
    cos, sin = np.cos(place.turn), np.sin(place.turn)
    flat = flat @ np.array([[cos, sin], [-sin, cos]]) + np.array([place.x, place.y])
    return np.column_stack([flat, np.full(len(flat), place.z)])


@lru_cache(maxsize=8)
def _echo(key: ArrayKey, acoustics: Acoustics, plate: float, middle: tuple[float, ...], points: bytes) -> Complex:
    places = np.frombuffer(points).reshape(-1, 3)
    return palm_echo(places, key.array, middle=np.array(middle), diameter=plate, acoustics=acoustics)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayField:
    """Model of the cells' output under the beam while an array plays codes, at the frequencies within the band."""

    array: TransducerArray
    """Nominal array."""
    codes: ArrayCodes
    acoustics: Acoustics
    calibration: Calibration
    """Calibration of the sensor."""
    height: float = HEIGHT
    """Assumed height of the sensor above the array, in m."""
    rate: float = RATE
    """Rate of the sensor in Hz: a whole multiple of the codes' rate."""
    band: tuple[float, float] = BAND
    """(low, high) in Hz."""
    steps: int = 8
    """Time steps per frame."""
    aperture: float = 8e-3
    """Side of the square over which a cell averages, in m."""
    plate: float = 0.0
    """Diameter in m of the rigid plate in which the sensor lies; 0 for none, without echo."""

    def matrix(self, place: SensorPlace) -> tuple[Complex, Array]:
        """Transfer matrix (point, transducer) in roots of Pa to points around the cells, and weights (cell, point)."""
        points, model = self._grid(place)
        G = self.field(self.points(place), place)
        factor = float(radiation_pressure(np.ones(1), self.acoustics.medium)[0]) * place.gain
        return G * np.sqrt(factor), cell_weights(model, points, between="waves")

    def field(self, points: Array, place: SensorPlace) -> Complex:
        """Sound at points (point, 3) in Pa for each transducer, with the echo of the plate, (point, transducer)."""
        G = transfer_matrix(points, self.array.nominal, acoustics=self.acoustics)
        return G if not place.reflection else G + place.reflection * self.echo(points, place)

    def echo(self, points: Array, place: SensorPlace) -> Complex:
        """`palm_echo` of the plate at points (point, 3), of a rigid face, (point, transducer)."""
        middle, key = (place.x, place.y, place.z), ArrayKey(self.array.nominal)
        return _echo(key, self.acoustics, self.plate, middle, np.ascontiguousarray(points).tobytes())

    def points(self, place: SensorPlace) -> Array:
        """Positions of the points around the cells in m, shape (point, 3)."""
        points, sensor = self._grid(place)[0], self.calibration.sensor
        flat = points.position[:, :2] + np.mean([sensor.channel_position(cell) for cell in self.codes.cells], axis=0)
        return placed(flat, place)

    def _grid(self, place: SensorPlace) -> tuple[ControlGrid, SensorModel]:
        """Grid of points around the cells under the beam, and the sensor with these cells only."""
        sensor = self.calibration.sensor
        rows, columns = (np.unique(axis) for axis in np.divmod(self.codes.cells, sensor.columns))
        some = SensorGrid(rows=len(rows), columns=len(columns), pitch=sensor.pitch, name=sensor.name)
        model = SensorModel(grid=some, aperture=self.aperture, spread=place.spread)
        # Interference patterns have no detail below half a wavelength; 2 mm is less than half of that.
        pitch, reach = 2e-3, self.aperture / 2 + 6e-3
        wide = [int(np.ceil(((count - 1) * sensor.pitch + 2 * reach) / pitch)) for count in (len(rows), len(columns))]
        return ControlGrid(rows=wide[0], columns=wide[1], pitch=pitch, height=place.z), model

    def window(self, group: int) -> tuple[int, int]:
        """First and last frame of a group's codes, with half of the steady period on both sides."""
        first, half = self.codes.starts[group], self.codes.settle // 2
        return first - half, first + len(self.codes.codes[group]) + half

    def answer(self, group: int, place: SensorPlace) -> tuple[NDArray[np.int64], Complex]:
        """Bins of a group's window within the band, and the response of each cell in them, shape (bin, cell)."""
        begin, end = self.window(group)
        frames = round((end - begin) * self.rate / self.codes.rate)
        frequency = np.asarray(np.fft.rfftfreq(frames, 1 / self.rate), np.float64)
        bins = np.flatnonzero((frequency >= self.band[0]) & (frequency <= self.band[1]))
        channels = self.calibration.response_at(frequency[bins]).reshape(len(bins), -1)[:, list(self.codes.cells)]
        late = np.exp(-2j * np.pi * frequency[bins] * place.late)[:, None]
        return bins, np.asarray(channels * late, np.complex128)

    def spectrum(self, samples: Array, group: int) -> Complex:
        """Measured spectrum of a group's window, shape (bin, cell), from samples of shape (frame, channel)."""
        per = round(self.rate / self.codes.rate)
        begin, end = (frame * per for frame in self.window(group))
        if end > len(samples):
            raise ShapeError(f"recording: expected {end} frames of codes or more, got {len(samples)}")
        bins, _ = self.answer(group, SensorPlace())
        some = samples[begin:end][:, list(self.codes.cells)]
        return np.fft.rfft(some - some.mean(axis=0), axis=0)[bins] / len(some)

    def predicted(self, pressure: Array, group: int, place: SensorPlace) -> Complex:
        """Predicted spectrum of the output within the band, for a pressure (step, cell) or (step, cell, unknown)."""
        bins, answer = self.answer(group, place)
        whole = np.fft.rfft(pressure, axis=0)[bins] / len(pressure)
        return whole * answer.reshape(*answer.shape, *([1] * (pressure.ndim - 2)))

    def followed(self, group: int, pole: Complex) -> tuple[Complex, Complex]:
        """Relative output of each transducer of a group over time, and its derivative with respect to the pole.

        q(t + dt) = c + (q(t) - c) e^(p dt), with the pole p in rad/s. Both results are complex, of shape (step,
        transducer of the group); the derivative is in s/rad.
        """
        members, half = self.codes.groups[group], self.codes.settle // 2
        code = np.pad(self.codes.codes[group].astype(np.int64), ((half, half), (0, 0)))
        command = self.codes.level * np.exp(1j * (self.codes.still[members] + np.pi / 2 * code))
        time = np.arange(1, self.steps + 1)[:, None] / (self.codes.rate * self.steps)
        decay = np.exp(pole * time)
        q = np.empty((len(command), self.steps, len(members)), complex)
        change = np.empty_like(q)
        now, moving = command[0], np.zeros(len(members), complex)
        for frame, drive in enumerate(command):
            change[frame] = (moving + time * (now - drive)) * decay
            q[frame] = drive + (now - drive) * decay
            now, moving = q[frame, -1], change[frame, -1]
        return q.reshape(-1, len(members)), change.reshape(-1, len(members))


def cell_places(model: ArrayField, place: SensorPlace) -> Array:
    """Position of the cells under the beam in m, shape (cell, 3)."""
    return placed(np.array([model.calibration.sensor.channel_position(cell) for cell in model.codes.cells]), place)
