"""A simulated array and the skin that it presses on, with a microphone sensor, and simulated units for live touch."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from midair.array_types import Array
from midair.devices.arrays.immediate import OUTCOMES, ImmediateArray, ImmediateUnits
from midair.devices.arrays.silencer import SilencerChoice, silencer_named
from midair.devices.frame_bytes import Bytes
from midair.devices.interface import ArrayDevice, FrameBlock, PlayReport, SensorDevice
from midair.errors import DeviceStateError, InputError, RateError, ShapeError
from midair.model import (
    HEIGHT,
    RATE,
    Acoustics,
    ControlGrid,
    Drive,
    PalmPath,
    Placement,
    PressureFrames,
    Progress,
    TransducerArray,
)
from midair.physics import (
    MovingSpread,
    PlaybackChain,
    SensorModel,
    Spread,
    TransducerDynamics,
    Transducers,
    TransducerState,
    Waves,
    calibration_of,
    cell_weights,
    fade_window,
    middle_of,
    palm_matrix,
    radiate,
    sense,
    simulate,
    steps_per_frame,
    storage_precision,
)
from midair.streaming import LazyFrames, TempFrames, cached_blocks


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
        self._pressed.append(stroke.pressure)

    def press(self, pressure: Array) -> None:
        """Append radiation pressure on the points of the skin, shape (step, point), in Pa."""
        self._pressed.append((pressure @ self._weights.T).reshape(-1, *self.model.grid.shape))

    def pressure(self, steps: int) -> LazyFrames:
        """Pressure on the cells since the last clear, at least `steps` long, shape (step, row, column), in Pa."""
        return self._pressed.reel(steps)


class VirtualSensor(SensorDevice):
    """Measures the pressure on a `VirtualSkin`; its time advances only when it is read.

    The first `WHOLE` seconds are computed at once, and longer times piece by piece as they are read.

    `skin` is the skin at the sensor's position, whose model is the sensor's. `touch` is the pressure of an object on
    the skin from start on, at the skin's rate, which must be a multiple of `rate`, the frames per second in Hz. `seed`
    is that of the noise.
    """

    unit = "V"
    simulated = True
    on_demand = True

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
        part = np.asarray(self._samples[first : self._taken])
        return FrameBlock(samples=part, first=first, device_time=now, host_time=now)

    def stop(self) -> None:
        """Stop sampling."""
        self._sampling = False

    def _sense(self, frames: int) -> np.ndarray | LazyFrames:
        pressure, over = self._skin.pressure(frames * self._oversample), self._oversample
        if len(pressure) > WHOLE * self.rate * over:
            piece = round(WHOLE * self.rate)
            return cached_blocks(self._piece, (ENDLESS, *self.grid.shape), size=piece)
        felt, rng = pressure[: len(pressure) // over * over], np.random.default_rng(self._seed)
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


class VirtualArray(ArrayDevice):
    """Simulates playback with transducer dynamics, quantised phases, and deviations of the transducers from the model.

    The deviations are intended: they are what calibration and correction measure and compensate.

    `skin` is the surface that the sound presses on, in poses `palm` in array coordinates from the first frame of each
    play on, the last of which holds; it rests in the middle above the array if None. `reflection` is the factor of the
    array's face, for the echo of a skin as wide as a palm. `acoustics` is the air in which
    the sound propagates, whatever a drive was solved for; each drive's own if None. `chain` has the transducers and
    all effects but the silencer; that of `usual_transducers` if None.
    """

    simulated = True
    gated = False
    streams = True

    def __init__(
        self,
        array: TransducerArray,
        skin: VirtualSkin | None = None,
        *,
        acoustics: Acoustics | None = None,
        silencer: SilencerChoice = "off",
        chain: PlaybackChain | None = None,
        palm: PalmPath | None = None,
        reflection: complex = 0.0,
        name: str = "virtual",
    ) -> None:
        self.name, self.array = name, array
        self.acoustics, self.reflection = acoustics, reflection
        self.silencer: SilencerChoice = silencer
        self.chain = chain or PlaybackChain(transducers=usual_transducers(array.count))
        self._skin, self.palm = skin, palm
        self._air: Acoustics | None = None
        self._open = False
        self._now = TransducerState.silent(array.count)

    @property
    def emitting(self) -> bool:
        """True while any sound is emitted."""
        return bool(np.abs(self._now.q).max() > 0)

    def open(self) -> None:
        """Open the array; it is silent."""
        self._open = True
        self.silence()

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Compute the pressure of every frame on the skin, block by block."""
        if not self._open:
            raise DeviceStateError("virtual array: expected open before play")
        acoustics = self.acoustics or Acoustics(medium=drive.acoustics.medium)
        skin = self._skin
        if skin is not None and self._air != acoustics:
            places, middle = skin.points.position, middle_of(skin.points)
            self._matrix = palm_matrix(
                places, self.array, reflection=self.reflection, middle=middle, acoustics=acoustics
            )
            self._pressure = self._propagation(skin, acoustics)
            self._air = acoustics
        silencer, chain = silencer_named(self.silencer, drive.rate), self.chain
        if self.silencer != "off":
            chain = replace(chain, phase_ramp=silencer.phase, level_ramp=silencer.intensity)
        steps = 1 if skin is None else steps_per_frame(drive.rate, skin.rate)
        if skin is not None and delay:
            skin.press(np.zeros((round(delay * drive.rate) * steps, skin.points.count)))
        total = drive.frames * repeats
        for before in range(0, total, drive.frames):
            if chain.hold == "ideal" and skin is not None:
                skin.press(simulate(drive, self._matrix, chain=chain, rate=skin.rate, acoustics=acoustics))
            done, moment = 0, before * steps
            for q, now in radiate(drive, chain, steps, start=self._now):
                with self.sounding():
                    self._now = now
                done += len(q) // steps
                if chain.hold == "step" and skin is not None:
                    skin.press(self._pressure(q, moment))
                moment += len(q)
                if progress:
                    progress(before + done, total)
        return PlayReport(frames=total, duration=total / drive.rate, silencer=str(silencer))

    def silence(self) -> None:
        """Stop all sound immediately."""
        self._now = TransducerState.silent(self.array.count)

    def close(self) -> None:
        """Close the array."""
        self._open = False

    def _propagation(self, skin: VirtualSkin, acoustics: Acoustics) -> Callable[[Waves, int], Array]:
        """Function from waves and their first step in a play to the pressure on the points of the skin."""
        if self.palm is None:
            still = Spread.of(self._matrix, acoustics.medium, None, self.chain.precision)
            return lambda q, _: still.pressure(q)
        if self.chain.hold == "ideal":
            raise InputError("virtual array: expected frames that are held for a palm that moves, got an ideal hold")
        if self.reflection:
            raise InputError("virtual array: expected a palm at rest under an echo, got one that moves")
        return MovingSpread(
            skin.points.position,
            self.array,
            acoustics,
            solved=middle_of(skin.points),
            path=self.palm,
            rate=skin.rate,
            precision=self.chain.precision,
        ).pressure


def usual_transducers(
    count: int, dynamics: TransducerDynamics | None = None, *, seed: int = 0, **changes: float
) -> Transducers:
    """Transducers with usual differences; `changes` are arguments of `Transducers.varied` that differ."""
    usual = {"gain": 0.9, "gain_spread": 0.05, "resonance_spread": 50.0, "quality_spread": 0.05}
    return Transducers.varied(count, dynamics, seed=seed, **usual | changes)


class VirtualUnits(ImmediateUnits):
    """Accepts frames without sound; keeps the last `kept` of them as (phases, intensity, instant)."""

    emulated = True
    failsafe = 0.0

    def __init__(self, kept: int = 0) -> None:
        self.frames: deque[tuple[Bytes, int, int]] = deque(maxlen=kept)
        self._counts: dict[str, int] = dict.fromkeys(OUTCOMES, 0)
        self._sent_at = np.zeros(64, np.int64)
        self._number = 0

    def now(self) -> int:
        """Device time, in ns."""
        return time.monotonic_ns()

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Accept a frame, unless its instant has passed."""
        number, self._number = self._number, self._number + 1
        now = self._sent_at[number % 64] = time.monotonic_ns()
        if now >= instant:
            self._sent_at[number % 64] = 0
            self._counts["late"] += 1
            return
        self._counts["sent"] += 1
        self._counts["answered"] += 1
        if self.frames.maxlen:
            self.frames.append((phases.copy(), intensity, instant))

    def sent(self, number: int) -> int:
        """Time at which a frame was accepted, in ns of `time.monotonic_ns`."""
        return int(self._sent_at[number % 64])

    def counts(self) -> dict[str, int]:
        """Number of frames by outcome."""
        return dict(self._counts)

    def state(self) -> None:
        """None: there are no units to query."""

    def silence(self) -> None:
        """Add a silent frame."""
        if self.frames:
            phases, _, _ = self.frames[-1]
            self.frames.append((np.zeros_like(phases), 0, time.monotonic_ns()))

    def describe(self) -> dict[str, str]:
        """Description of the units."""
        return {"units": "virtual, without sound"}


def virtual_immediate(
    placement: Placement | None = None, *, hold: float = 0.006, units: VirtualUnits | None = None
) -> ImmediateArray:
    """An immediate array without sound; pass `units` to inspect the frames that they received."""
    own = units or VirtualUnits()
    return ImmediateArray(
        lambda _: own, placement or Placement.grid(), name="virtual", hold=hold, simulated=True, gated=False
    )
