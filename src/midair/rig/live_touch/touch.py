"""From one sensor frame to phases within a millisecond: the causal form of the stages of `pipeline`.

Settings that other modes derive from a whole recording must be given here: the level of the drive and the constant
offset. Memory is allocated once, before the first frame.
"""

import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.calibration import CausalInverse, causal_error
from midair.dsp import band_edges, check_band
from midair.model import BAND, Calibration, ControlGrid, PressureFrames, SensorGrid, TransducerArray
from midair.physics import focus_amplitude, playback_response, sound_amplitude
from midair.rig.live_touch.live_settings import LiveSettings
from midair.solvers import FrameTracker, Live, multi_plane_problem, symmetric_modes
from midair.targets import MappingStream, decouple, interpolation_matrix

Bytes = NDArray[np.uint8]


# The 200 iterations of the first frame delay later frames; the level rises from zero while they catch up. One more
# iteration of each kind compensates for the modes that symmetry adds, see `solvers.live`.
SOLVER = Live(iterations=12, lift_iterations=18, warm_iterations=8, warm_lift_iterations=10)
"""Solver of the phases."""

# At 2 kHz frames are more alike, and phases that follow less change less from frame to frame.
FINE_SOLVER = replace(SOLVER, warm_iterations=4, warm_lift_iterations=5)
"""Solver of the phases where a latency is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rehearsal:
    """Frames that were computed at their times, without an array, before the start."""

    frames: int
    late: int
    """Frames that were not ready a hold after their time."""
    longest: float
    """Longest time from the time of a frame until its phases were ready, in s."""

    def words(self) -> str:
        """Describe in one line."""
        keeps = self.late <= 0.01 * self.frames
        said = "this computer keeps up" if keeps else "this computer is too slow or too busy; close other programs"
        return f"{self.late} of {self.frames} frames late, longest {1e3 * self.longest:.3g} ms: {said}"


class Touch:
    """One stream of touch: `feel` a frame, then `form` the phases of its `formed` frames; with a latency several.

    `pressure`, shape (formed, channel), is the calibrated pressure in Pa, sampled `delay` s ago; `phases`, shape
    (transducer,), are those of the last audible frame in steps of 2 pi / 256; `error` is the error of the causal
    inverse in each of `parts`. `calibration` is None where frames arrive in Pa; `level` is the drive of every
    transducer in audible frames, 0 to 1; `grid` replaces the control points of the settings. `wanted`, shape (point,),
    is the target of the last frame, relative to a focus of the whole array.
    """

    parts = ((BAND[0], 40.0), (40.0, 100.0), (100.0, BAND[1]))

    def __init__(
        self,
        settings: LiveSettings,
        calibration: Calibration | None,
        sensor: SensorGrid,
        rate: float,
        array: TransducerArray,
        level: float,
        *,
        grid: ControlGrid | None = None,
    ) -> None:
        self.settings, grid = settings, grid or settings.grid
        self.schedule = settings.schedule(rate)
        formed, delay = self.schedule.formed, self.schedule.delay
        self._inverse: list[CausalInverse] = []
        self.error: Array | None = None
        if calibration is not None:
            band = check_band(settings.band, rate)
            if settings.latency is not None:
                calibration = _with_playback(calibration, formed * rate)
            # Later frames of a sample are delayed by less: the band-limited inverse interpolates.
            self._inverse = [
                CausalInverse(calibration, rate, band=band, delay=delay - each / (formed * rate))
                for each in range(formed)
            ]
            # The band itself if no part of the default one overlaps it.
            inside = [(max(low, band[0]), min(high, band[1])) for low, high in self.parts]
            self.parts = tuple((low, high) for low, high in inside if high > low) or (band,)
            self.error = causal_error(
                self._inverse[0].fir,
                calibration,
                rate,
                band,
                delay=delay,
                parts=self.parts,
                edges=band_edges(band, rate),
            )
        mapping = self.schedule.mapping
        self._mapping = MappingStream(mapping, formed * rate, offset=settings.offset, band=settings.band)
        medium = settings.acoustics.medium
        focus = focus_amplitude(grid, array, acoustics=settings.acoustics)
        # Sound amplitude of 1 Pa relative to the focus: amplitude is proportional to the square root of pressure.
        self._unit = float(sound_amplitude(np.array(1.0), medium)) / focus
        self._apart, self._between = _decoupling_matrix(sensor, grid, rate), interpolation_matrix(sensor, grid)
        none = np.zeros((1, grid.count))
        problem = multi_plane_problem([grid.position], none, array, acoustics=settings.acoustics)
        problem = replace(problem, level=level)
        solver = SOLVER if settings.latency is None else FINE_SOLVER
        mirrored = symmetric_modes(grid, array, acoustics=settings.acoustics, tolerance=solver.tolerance)
        self._begin = partial(solver.begin, problem, folded=mirrored)
        self._follower: FrameTracker = self._begin()
        self.pressure, self._pushes = np.zeros((formed, sensor.count)), np.zeros((formed, sensor.count))
        self.wanted, self._steps = np.zeros(grid.count), np.zeros(array.count)
        self._whole, self.phases = np.zeros(array.count, np.int16), np.zeros(array.count, np.uint8)
        self.delay = (delay if self._inverse else 0.0) + self._mapping.delay / (formed * rate)

    def feel(self, frame: Array) -> None:
        """Process the sensor's next frame, shape (channel,), in its unit."""
        if not self._inverse:
            self.pressure[:] = frame
        for inverse, pressure in zip(self._inverse, self.pressure, strict=False):
            inverse.step(frame, pressure)
        np.dot(self.pressure, self._apart, out=self._pushes)
        self._pushes *= self.settings.gain
        ready = self._mapping.push(self._pushes)
        self._pushes[:] = ready if len(ready) else 0.0

    def form(self, at: int = 0, *, hurried: bool = False) -> bool:
        """Compute the phases of a frame of the last sample, in half the time if `hurried`; False for a silent one."""
        if self._pushes[at].max() <= self.settings.faintest:
            return False
        self._solve(self._pushes[at], hurried=hurried)
        return True

    def rehearse(self, rate: float, hold: float, *, frames: int = 400) -> Rehearsal:
        """Compute phases of random pressure in real time, as the loop will; the state of the stream stays."""
        kept, self._follower = self._follower, self._begin()
        rng, took, pushes = np.random.default_rng(0), np.zeros(frames), np.full(self._pushes.shape[1], 10.0)
        # The first frame takes longer.
        self._solve(pushes, hurried=False)
        begin = time.monotonic()
        for number in range(frames):
            due = begin + (number + 1) / rate
            time.sleep(max(0.0, due - time.monotonic()))
            rng.random(out=pushes)
            self._solve(pushes, hurried=time.monotonic() - due > hold / 2)
            took[number] = time.monotonic() - due
        self._follower = kept
        self.phases[:] = 0
        return Rehearsal(frames=frames, late=int((took > hold).sum()), longest=float(took.max()))

    def _solve(self, pushes: Array, *, hurried: bool) -> None:
        # Pressure is interpolated, not amplitude, as in the best mode.
        np.dot(self._between, pushes, out=self.wanted)
        np.sqrt(self.wanted, out=self.wanted)
        self.wanted *= self._unit
        np.multiply(self._follower.follow(self.wanted, hurried=hurried), 256 / (2 * np.pi), out=self._steps)
        np.rint(self._steps, out=self._whole, casting="unsafe")
        # 256 steps are one turn, so that the overflow of a byte is harmless.
        np.copyto(self.phases, self._whole, casting="unsafe")


def _decoupling_matrix(sensor: SensorGrid, grid: ControlGrid, rate: float) -> Array:
    """Matrix that corrects for the pressure that cells receive from neighbouring cells, shape (channel, channel)."""
    each = np.eye(sensor.count).reshape(sensor.count, *sensor.shape)
    alone = PressureFrames(pressure=each, rate=rate, sensor=sensor)
    return np.ascontiguousarray(decouple(alone, grid=grid).pressure.reshape(sensor.count, sensor.count))


def _with_playback(calibration: Calibration, rate: float) -> Calibration:
    """The calibration of sensor and playback in a row, so that its inverse compensates both."""
    first, last = calibration.frequency[0], calibration.frequency[-1]
    frequency = np.union1d(calibration.frequency, np.arange(first, last, 2.0))
    response = calibration.response_at(frequency) * playback_response(frequency, rate)[:, None, None]
    return replace(calibration, frequency=frequency, response=response, measurement=None)
