"""The simulated skin, where a virtual object or a virtual array presses on a virtual sensor."""

import numpy as np

from midair.array_types import Array
from midair.errors import RateError, ShapeError
from midair.model import HEIGHT, ControlGrid, PressureFrames
from midair.physics import SensorModel, cell_weights
from midair.streaming import LazyFrames, TempFrames, concatenate_lazy


class VirtualSkin:
    """Pressure on the cells of a sensor since it was last cleared, in time steps of 1 / rate.

    `model` is the sensor: its cells, and the spatial response of its gel. `height` is that of the sensor above the
    array, in m. `rate` is the time steps per second, in Hz, well above the sensor's frame rate.
    """

    def __init__(self, model: SensorModel, *, height: float = HEIGHT, rate: float = 8000.0) -> None:
        self.model = model
        self.rate = rate
        pitch, margin = model.grid.pitch / 4, 2
        self.points = ControlGrid(
            rows=4 * (model.grid.rows + margin),
            columns=4 * (model.grid.columns + margin),
            pitch=pitch,
            height=height,
        )
        self._weights = cell_weights(model, self.points, between="waves")
        self.clear()

    def clear(self) -> None:
        """Delete all pressure; time begins again at 0."""
        self._pressed = TempFrames(*self.model.grid.shape)
        self._lazy: LazyFrames | None = None

    def touch(self, stroke: PressureFrames) -> None:
        """Append the pressure of an object on the cells.

        Raises RateError if the rate of the stroke differs from the skin's, ShapeError if its cells differ.
        """
        if stroke.rate != self.rate:
            raise RateError(
                f"stroke: expected the skin's {self.rate:g} Hz, got {stroke.rate:g} Hz; generate it at that rate"
            )
        if stroke.sensor.shape != self.model.grid.shape:
            raise ShapeError(f"stroke: expected {self.model.grid.shape} cells, got {stroke.sensor.shape}")
        if isinstance(stroke.pressure, LazyFrames) and not self._pressed.frames:
            # Computed when it is read.
            self._lazy = stroke.pressure
        else:
            self._pressed.append(np.asarray(stroke.pressure))

    def press(self, pressure: Array) -> None:
        """Append radiation pressure on the points of the skin, shape (step, point), in Pa."""
        self._pressed.append((pressure @ self._weights.T).reshape(-1, *self.model.grid.shape))

    def pressure(self, steps: int) -> LazyFrames:
        """Pressure on the cells since the last clear, at least `steps` long, shape (step, row, column), in Pa."""
        pressed = self._pressed.reel() if self._lazy is None else concatenate_lazy([self._lazy, self._pressed.reel()])
        return pressed.followed(steps)
