"""Forward model of `array_fit`: transducer dynamics, pressure averaged over cells, and channel responses.

It also provides the derivatives with respect to every unknown.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.calibration.measure.array_plan import ArrayCodes
from midair.errors import ShapeError
from midair.model import BAND, HEIGHT, RATE, Acoustics, Calibration, ControlGrid, SensorGrid, TransducerArray
from midair.physics import SensorModel, cell_weights, radiation_pressure, transfer_matrix


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

    def matrix(self, place: SensorPlace) -> tuple[Complex, Array]:
        """Transfer matrix (point, transducer) in roots of Pa to points around the cells, and weights (cell, point)."""
        points, model = self._grid(place)
        G = transfer_matrix(self.points(place), self.array.nominal, acoustics=self.acoustics)
        factor = float(radiation_pressure(np.ones(1), self.acoustics.medium)[0]) * place.gain
        return G * np.sqrt(factor), cell_weights(model, points, between="waves")

    def points(self, place: SensorPlace) -> Array:
        """Positions of the points around the cells in m, shape (point, 3)."""
        points, sensor = self._grid(place)[0], self.calibration.sensor
        flat = points.position[:, :2] + np.mean([sensor.channel_position(cell) for cell in self.codes.cells], axis=0)
        turned = flat @ np.array([[np.cos(place.turn), np.sin(place.turn)], [-np.sin(place.turn), np.cos(place.turn)]])
        return np.column_stack([turned + np.array([place.x, place.y]), points.position[:, 2]])

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
