"""What a sensor says while an array plays codes: transducers follow, cells average, channels answer.

The forward model of `array_fit`, and how it changes with each thing that is not known.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.calibration.measure.array_plan import ArrayCodes
from midair.errors import ShapeError
from midair.model import Acoustics, Calibration, ControlGrid, SensorGrid, TransducerArray
from midair.physics import SensorModel, TransducerDynamics, cell_weights, radiation_pressure, transfer_matrix

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorPlace:
    """Where the sensor lies, and what else all transducers share.

    Attributes
    ----------
    x, y, z : float
        Of the middle of the sensor, in m; z is its height above the array.
    turn : float
        By which it is turned about the vertical, in rad.
    late : float
        By which the array begins after the first frame of the recording, in s.
    gain : float
        Pressure over that of the model.
    spread : float
        Standard deviation with which the gel spreads a point, in m.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.2
    turn: float = 0.0
    late: float = 0.0
    gain: float = 1.0
    spread: float = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayField:
    """The way from codes to what the cells under the beam say, in the frequencies that count.

    Attributes
    ----------
    array : TransducerArray
        As its model says it is.
    codes : ArrayCodes
        What is played.
    acoustics : Acoustics
        Air and directivity.
    calibration : Calibration
        Of the sensor.
    band : tuple of float
        (low, high) of what counts, in Hz.
    steps : int
        Moments a frame.
    height : float
        Where the sensor is believed to lie above the array, in m.
    rate : float
        Of the sensor, in Hz: a whole multiple of the codes' rate.
    aperture : float
        Side of the square over which a cell averages, in m.
    """

    array: TransducerArray
    codes: ArrayCodes
    acoustics: Acoustics
    calibration: Calibration
    height: float = 0.2
    rate: float = 1000.0
    band: tuple[float, float] = (20.0, 470.0)
    steps: int = 8
    aperture: float = 8e-3

    def matrix(self, place: SensorPlace) -> tuple[Complex, Array]:
        """Full drive of each transducer to sound at points around the cells, and how these average it.

        Returns
        -------
        G : ndarray of complex, shape (point, transducer)
            In roots of Pa of radiation pressure.
        weights : ndarray, shape (cell, point)
            Of the cells that the beam is on.
        """
        sensor = self.calibration.sensor
        rows, columns = (np.unique(axis) for axis in np.divmod(self.codes.cells, sensor.columns))
        some = SensorGrid(rows=len(rows), columns=len(columns), pitch=sensor.pitch, name=sensor.name)
        middle = np.mean([sensor.channel_position(cell) for cell in self.codes.cells], axis=0)
        model = SensorModel(grid=some, aperture=self.aperture, spread=place.spread)
        # What interferes has no detail finer than half a wavelength, of which two millimetres are less than half.
        pitch, reach = 2e-3, self.aperture / 2 + 6e-3
        wide = [int(np.ceil(((count - 1) * sensor.pitch + 2 * reach) / pitch)) for count in (len(rows), len(columns))]
        points = ControlGrid(rows=wide[0], columns=wide[1], pitch=pitch, height=place.z)
        weights = cell_weights(model, points, between="waves")
        flat = points.position[:, :2] + middle
        turned = flat @ np.array([[np.cos(place.turn), np.sin(place.turn)], [-np.sin(place.turn), np.cos(place.turn)]])
        at = np.column_stack([turned + np.array([place.x, place.y]), points.position[:, 2]])
        G = transfer_matrix(at, self.array.nominal, acoustics=self.acoustics)
        factor = float(radiation_pressure(np.ones(1), self.acoustics.medium)[0]) * place.gain
        return G * np.sqrt(factor), weights

    def window(self, group: int) -> tuple[int, int]:
        """Frames of the codes that belong to a group, with half of the stillness on both sides."""
        first, half = self.codes.starts[group], self.codes.settle // 2
        return first - half, first + len(self.codes.codes[group]) + half

    def answer(self, group: int, place: SensorPlace) -> tuple[NDArray[np.int64], Complex]:
        """Which bins of a group's window count, and the answer of each cell in them, shape (bin, cell)."""
        begin, end = self.window(group)
        frames = round((end - begin) * self.rate / self.codes.rate)
        frequency = np.asarray(np.fft.rfftfreq(frames, 1 / self.rate), np.float64)
        bins = np.flatnonzero((frequency >= self.band[0]) & (frequency <= self.band[1]))
        channels = self.calibration.response_at(frequency[bins]).reshape(len(bins), -1)[:, list(self.codes.cells)]
        late = np.exp(-2j * np.pi * frequency[bins] * place.late)[:, None]
        return bins, np.asarray(channels * late, np.complex128)

    def spectrum(self, samples: Array, group: int) -> Complex:
        """What was recorded in a group's window, shape (bin, cell), of samples of shape (frame, channel)."""
        per = round(self.rate / self.codes.rate)
        begin, end = (frame * per for frame in self.window(group))
        if end > len(samples):
            raise ShapeError(f"recording: expected {end} frames of codes or more, got {len(samples)}")
        bins, _ = self.answer(group, SensorPlace())
        some = samples[begin:end][:, list(self.codes.cells)]
        return np.fft.rfft(some - some.mean(axis=0), axis=0)[bins] / len(some)

    def predicted(self, pressure: Array, group: int, place: SensorPlace) -> Complex:
        """What the cells say in the bins that count of a pressure, shape (moment, cell) or (moment, cell, unknown)."""
        bins, answer = self.answer(group, place)
        whole = np.fft.rfft(pressure, axis=0)[bins] / len(pressure)
        return whole * answer.reshape(*answer.shape, *([1] * (pressure.ndim - 2)))

    def followed(self, group: int, pole: Complex) -> tuple[Complex, Complex]:
        """What each transducer of a group radiates of its settled response, and how that changes with its pole.

        q(t + dt) = c + (q(t) - c) e^(p dt), and its derivative with p in the same steps.

        Parameters
        ----------
        group : int
            Number of the group.
        pole : ndarray of complex, shape (transducer of the group,)
            In rad/s.

        Returns
        -------
        q, change : ndarray of complex, shape (moment, transducer of the group)
            The change is in s/rad.
        """
        code, members, settle = self.codes.codes[group], self.codes.groups[group], self.codes.settle
        told = self.codes.level * np.exp(1j * (self.codes.still[members] + np.pi / 2 * _padded(code, settle // 2)))
        time = np.arange(1, self.steps + 1)[:, None] / (self.codes.rate * self.steps)
        decay = np.exp(pole * time)
        q = np.empty((len(told), self.steps, len(members)), complex)
        change = np.empty_like(q)
        now, moving = told[0], np.zeros(len(members), complex)
        for frame, drive in enumerate(told):
            change[frame] = (moving + time * (now - drive)) * decay
            q[frame] = drive + (now - drive) * decay
            now, moving = q[frame, -1], change[frame, -1]
        return q.reshape(-1, len(members)), change.reshape(-1, len(members))


def _padded(code: NDArray[np.int8], settle: int) -> NDArray[np.int64]:
    return np.pad(code.astype(np.int64), ((settle, settle), (0, 0)))


def pole_of(dynamics: TransducerDynamics) -> complex:
    """-1 / time constant + j detuning, in rad/s."""
    return complex(-1 / dynamics.time_constant, dynamics.detuning)
