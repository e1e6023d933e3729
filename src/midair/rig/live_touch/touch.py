"""From one frame of a sensor to the phases that press the same, within a millisecond: the stages of `flow`, causal.

What a whole recording lets a stage look up, it must be told here: the level of the drive, and the offset of cells that
pull. Memory is taken once, before the first frame.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from midair.calibration import CausalInverse, causal_error
from midair.dsp import band_edges, check_band
from midair.errors import InputError
from midair.model import Acoustics, Calibration, ControlGrid, PressureFrames, SensorGrid, TransducerArray
from midair.physics import focus_amplitude, sound_amplitude
from midair.solvers import FrameTracker, Live, problem_at, symmetric_modes
from midair.targets import MappingStream, decouple, interpolation_matrix

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchSettings:
    """How touch is made of what a sensor feels.

    Attributes
    ----------
    band : tuple of float
        (low, high) of what is felt, in Hz.
    delay : float
        Of the causal inverse, in s: 2 to 10 ms; see `midair.calibration.causal_fir`.
    mapping : {"half-wave", "constant-offset", "slow-bias"}
        From pressure of both signs to pressure that pushes.
    offset : float or None
        Of the constant offset, in Pa.
    gain : float
        Multiplies the pressure.
    faintest : float
        Pressure on the loudest cell below which a frame is silence, in Pa: the sensor's own noise is not to be played.
    grid : ControlGrid
        The control points.
    acoustics : Acoustics
        Of the air.
    solver : Live
        Of the phases.
    """

    band: tuple[float, float] = (20.0, 470.0)
    delay: float = 0.006
    mapping: str = "half-wave"
    offset: float | None = None
    gain: float = 1.0
    faintest: float = 0.1
    grid: ControlGrid = field(default_factory=ControlGrid)
    acoustics: Acoustics = field(default_factory=Acoustics)
    # A first frame of 200 iterations makes those behind it late; the level rises from nothing while they catch up. One
    # more of each for every frame make up for the modes that folding adds, see `solvers.live.folded`.
    solver: Live = field(
        default_factory=lambda: Live(iterations=12, lift_iterations=18, warm_iterations=8, warm_lift_iterations=10)
    )

    def __post_init__(self) -> None:
        if not 0.002 <= self.delay <= 0.01:
            raise InputError(f"delay: expected 2 to 10 ms of the causal inverse, got {1e3 * self.delay:g} ms")
        if not 0 < self.gain < np.inf:
            raise InputError(f"gain: expected above 0, got {self.gain:g}")
        if not 0 <= self.faintest < np.inf:
            raise InputError(f"faintest: expected 0 Pa or more, got {self.faintest:g} Pa")


class Touch:
    """One stream of touch: `feel` a frame, then `form` the phases of what was felt.

    Parameters
    ----------
    settings : TouchSettings
        How.
    calibration : Calibration or None
        Of the sensor; None where it gives pressure that was undone elsewhere, which then is taken as it is.
    sensor : SensorGrid
        Its cells.
    rate : float
        Frames per second, in Hz.
    array : TransducerArray
        That plays.
    level : float
        Drive of every transducer while something is to be felt, 0 to 1.

    Attributes
    ----------
    pressure : ndarray, shape (channel,)
        What is to press now, in Pa, before the mapping: felt `delay` ago.
    phases : ndarray of uint8, shape (transducer,)
        Of the last frame that sounds, in steps of 2 pi / 256.
    delay : float
        Between what was felt and `pressure`, and between that and what is played, in s.
    error : ndarray, shape (part,) or None
        Of the causal inverse, in `parts` of the band; None where there is none.
    """

    parts = ((20.0, 40.0), (40.0, 100.0), (100.0, 470.0))

    def __init__(
        self,
        settings: TouchSettings,
        calibration: Calibration | None,
        sensor: SensorGrid,
        rate: float,
        array: TransducerArray,
        level: float,
    ) -> None:
        self.settings = settings
        self._inverse: CausalInverse | None = None
        self.error: Array | None = None
        if calibration is not None:
            band = check_band(settings.band, rate)
            self._inverse = CausalInverse(calibration, rate, band=band, delay=settings.delay)
            self.parts = tuple((low, high) for low, high in _parts(self.parts, band))
            self.error = causal_error(
                self._inverse.fir,
                calibration,
                rate,
                band,
                delay=settings.delay,
                parts=self.parts,
                edges=band_edges(band, rate),
            )
        self._mapping = MappingStream(settings.mapping, rate, offset=settings.offset, band=settings.band)
        medium, grid = settings.acoustics.medium, settings.grid
        focus = focus_amplitude(grid, array, acoustics=settings.acoustics)
        # P -> p of the control points in units of the focus: sound goes with the root of the pressure.
        self._unit = float(sound_amplitude(np.array(1.0), medium)) / focus
        self._apart, self._between = _undone(sensor, grid, rate), interpolation_matrix(sensor, grid)
        none = np.zeros((1, grid.count))
        problem = problem_at([grid.position], none, array, acoustics=settings.acoustics)
        problem = replace(problem, level=level)
        mirrored = symmetric_modes(grid, array, acoustics=settings.acoustics, tolerance=settings.solver.tolerance)
        self._follower: FrameTracker = settings.solver.begin(problem, folded=mirrored)
        self.pressure, self._pushes = np.zeros(sensor.count), np.zeros(sensor.count)
        self._wanted, self._steps = np.zeros(grid.count), np.zeros(array.count)
        self._whole, self.phases = np.zeros(array.count, np.int16), np.zeros(array.count, np.uint8)
        self.delay = (settings.delay if self._inverse is not None else 0.0) + self._mapping.delay / rate
        self._slow = self._mapping.delay > 0

    def feel(self, frame: Array) -> None:
        """Take the sensor's next frame, shape (channel,), in its unit."""
        if self._inverse is None:
            self.pressure[:] = frame
        else:
            self._inverse.step(frame, self.pressure)

    def form(self, *, hurried: bool = False) -> bool:
        """Phases of what was felt, into `phases`, in half the time if `hurried`; False where it is silence."""
        np.dot(self._apart, self.pressure, out=self._pushes)
        self._pushes *= self.settings.gain
        if self._slow:
            ready = self._mapping.push(self._pushes[None])
            self._pushes[:] = ready[0] if len(ready) else 0.0
        elif self.settings.offset is not None:
            self._pushes += self.settings.offset
        np.maximum(self._pushes, 0.0, out=self._pushes)
        if self._pushes.max() <= self.settings.faintest:
            return False
        # Pressure is interpolated, as in the best mode: between the cells it is what presses.
        np.dot(self._between, self._pushes, out=self._wanted)
        np.sqrt(self._wanted, out=self._wanted)
        self._wanted *= self._unit
        np.multiply(self._follower.follow(self._wanted, hurried=hurried), 256 / (2 * np.pi), out=self._steps)
        np.rint(self._steps, out=self._whole, casting="unsafe")
        # A turn is 256 steps, and so is a byte.
        np.copyto(self.phases, self._whole, casting="unsafe")
        return True

    @property
    def wanted(self) -> Array:
        """What `form` asked for at the control points, shape (point,), over the focus of the whole array."""
        return self._wanted


def _parts(parts: tuple[tuple[float, float], ...], band: tuple[float, float]) -> list[tuple[float, float]]:
    """The parts of the usual band that lie in this one, cut to it; itself where none does."""
    inside = [(max(low, band[0]), min(high, band[1])) for low, high in parts]
    return [(low, high) for low, high in inside if high > low] or [band]


def _undone(sensor: SensorGrid, grid: ControlGrid, rate: float) -> Array:
    """The matrix that undoes what a cell feels of what is played for its neighbours, shape (channel, channel)."""
    each = np.eye(sensor.count).reshape(sensor.count, *sensor.shape)
    alone = PressureFrames(pressure=each, rate=rate, sensor=sensor)
    return np.ascontiguousarray(decouple(alone, grid=grid).pressure.reshape(sensor.count, sensor.count).T)
