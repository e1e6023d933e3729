"""The simulated skin, where an object or a virtual array presses, and a simulated microphone sensor on it."""

from typing import Any, cast

import numpy as np

from midair.array_types import Array
from midair.devices.interface import FrameBlock, SensorDevice
from midair.errors import DeviceStateError, RateError, ShapeError
from midair.model import HEIGHT, RATE, ControlGrid, PressureFrames
from midair.physics import (
    SensorModel,
    calibration_of,
    cell_weights,
    fade_window,
    sense,
    sense_lazily,
    storage_precision,
)
from midair.streaming import LazyFrames, TempFrames, cached_blocks, concatenate_lazy


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
            rows=4 * (model.grid.rows + margin), columns=4 * (model.grid.columns + margin), pitch=pitch, height=height
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


class VirtualSensor(SensorDevice):
    """Measures the pressure on a `VirtualSkin`; its time advances only when it is read.

    With `streamed`, blocks are lazy frames, stored in temporary files. Otherwise the first `WHOLE` seconds are computed
    at once, and longer times piece by piece as they are read.

    `skin` is the skin at the sensor's position, whose model is the sensor's. `touch` is the pressure of an object on
    the skin from start on, at the skin's rate, which must be a multiple of `rate`, the frames per second in Hz. `seed`
    is that of the noise.
    """

    unit = "V"
    simulated = True
    on_demand = True
    streamed = False

    def __init__(
        self,
        skin: VirtualSkin,
        *,
        touch: PressureFrames | None = None,
        rate: float = RATE,
        seed: int = 0,
        name: str = "virtual",
    ) -> None:
        self.name, self.grid, self.rate = name, skin.model.grid, rate
        self.calibration, self.full_scale = calibration_of(skin.model), skin.model.full_scale
        self.stored = storage_precision(skin.model)
        self._skin, self._touch, self._seed = skin, touch, seed
        self._oversample = round(skin.rate / rate)
        self._samples: np.ndarray | LazyFrames = np.zeros((0, *self.grid.shape))
        self._taken, self._sampling = 0, False

    def open(self) -> None:
        """Do nothing: there is no device to open."""

    def start(self) -> None:
        """Clear the skin, apply the object's pressure if there is one, and start sampling."""
        self._skin.clear()
        if self._touch is not None:
            self._skin.touch(self._touch)
        self._samples = np.zeros((0, *self.grid.shape))
        self._taken, self._sampling = 0, True

    def read(self, frames: int) -> FrameBlock:
        """Return the next frames; all pressure must be applied before the first read."""
        if not self._sampling:
            raise DeviceStateError("virtual sensor: expected start before read")
        first, self._taken = self._taken, self._taken + frames
        if len(self._samples) < self._taken:
            # Compute more silence than this read needs, since each extension computes everything again.
            more = min(max(self._taken, 2 * len(self._samples)), round(WHOLE * self.rate))
            self._samples = self._sense(max(self._taken, more))
        now = first / self.rate
        part = self._samples[first : self._taken]
        if not self.streamed:
            part = np.asarray(part)
        # Lazy frames are typed as the array that they represent.
        return FrameBlock(samples=cast("Any", part), first=first, device_time=now, host_time=now)

    def stop(self) -> None:
        """Stop sampling."""
        self._sampling = False

    def close(self) -> None:
        """Do nothing: there is no device to close."""

    def _sense(self, frames: int) -> np.ndarray | LazyFrames:
        pressure, over = self._skin.pressure(frames * self._oversample), self._oversample
        if not self.streamed and len(pressure) > WHOLE * self.rate * over:
            piece = round(WHOLE * self.rate)
            return cached_blocks(self._piece, (ENDLESS, *self.grid.shape), size=piece, kept=2, stored=self.stored)
        felt, rng = pressure[: len(pressure) // over * over], np.random.default_rng(self._seed)
        if self.streamed:
            return sense_lazily(self._skin.model, felt, self.rate, rng=rng, oversample=over)
        return sense(self._skin.model, np.asarray(felt), self.rate, rng=rng, oversample=over)

    def _piece(self, first: int, last: int) -> np.ndarray:
        """Frames of one piece, sensed with the second before it, whose first half fades in, and the one after it."""
        over, around = self._oversample, round(self.rate)
        begin = max(0, first - around)
        pressure = self._skin.pressure((last + around) * over).read(begin * over, (last + around) * over)
        if begin < first:
            rise = fade_window(around * over // 2 + 1)[::-1, None, None]
            pressure = np.concatenate([rise * pressure[: len(rise)], pressure[len(rise) :]])
        rng = np.random.default_rng([self._seed, first] if first else self._seed)
        return sense(self._skin.model, pressure, self.rate, rng=rng, oversample=over)[first - begin : last - begin]


WHOLE = 20.0
"""Longest time in s that a virtual sensor computes at once."""

ENDLESS = 2**48
"""Number of frames of a sensor that is sensed piece by piece."""
