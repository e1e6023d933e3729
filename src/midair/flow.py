"""The paper on one page: from what the sensor said to what the array is told."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from midair.calibrate import calibrate
from midair.dsp import resample
from midair.model import (
    AmplitudeFrames,
    Calibration,
    ControlGrid,
    Medium,
    PressureFrames,
    Recording,
    Solution,
    TransducerArray,
)
from midair.physics import Directivity, focus_amplitude
from midair.prepare import Interpolated, prepare
from midair.solve import solve

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Everything that can be chosen on the way; the defaults are the paper's.

    Attributes
    ----------
    band : tuple of float
        (low, high) of the frequencies that are kept, in Hz (3).
    rate : float
        Frames per second of the drive, in Hz (3).
    inverse : {"fft", "fir"}
        How the channels' responses are undone.
    mapping : str
        From signed pressure to pressure that pushes (4.1).
    interpolate : {"amplitude", "pressure"}
        What is interpolated between the cells (4.1).
    gain : float
        Multiplies the pressure (5.2).
    grid : ControlGrid
        The control points (4.1).
    medium : Medium
        The air (2.1).
    directivity : {"point", "piston", "t4010a1"}
        Of a transducer (2.2).
    method : str
        The solver (4.2).
    iterations : int or tuple of int or None
        At most, (first frame, later frames); the method's own if None (5.2).
    start : {"previous", "zero"}
        Where the solver starts from (4.2).
    level : float
        Drive of every transducer, 0 to 1: the equal amplitude A (4.2).
    """

    band: tuple[float, float] = (20.0, 470.0)
    rate: float = 1000.0
    inverse: Literal["fft", "fir"] = "fft"
    mapping: str = "half-wave"
    interpolate: Interpolated = "amplitude"
    gain: float = 1.0
    grid: ControlGrid = field(default_factory=ControlGrid)
    medium: Medium = field(default_factory=Medium)
    directivity: Directivity = "t4010a1"
    method: str = "lm"
    iterations: int | tuple[int, int] | None = None
    start: Literal["previous", "zero"] = "previous"
    level: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reproduction:
    """What was made of a recording, stage by stage."""

    pressure: PressureFrames
    target: AmplitudeFrames
    solution: Solution

    def strength(self, settings: Settings) -> float:
        """The target's peak over the peak of a single focus of the whole array at full drive."""
        focus = focus_amplitude(
            settings.grid, self.solution.drive.array, medium=settings.medium, directivity=settings.directivity
        )
        return float(self.target.amplitude.max() / focus)


def felt(recording: Recording, calibration: Calibration | None, settings: Settings) -> PressureFrames:
    """The pressure that the sensor felt, in the settings' band and at their rate."""
    pressure = calibrate(recording, calibration, band=settings.band, method=settings.inverse)
    return at_rate(pressure, settings.rate)


def at_rate(pressure: PressureFrames, rate: float) -> PressureFrames:
    """The same pressure at another frame rate, band-limited; itself when the rate is right already."""
    if np.isclose(pressure.rate, rate, rtol=1e-9):
        return pressure
    return replace(
        pressure,
        pressure=resample(pressure.pressure, pressure.rate, rate),
        rate=rate,
        provenance=pressure.provenance.then("resample", {"from_hz": pressure.rate, "to_hz": rate}),
    )


def reproduce(
    pressure: PressureFrames, array: TransducerArray, settings: Settings, *, progress: Progress | None = None
) -> Reproduction:
    """The drive with which the array presses as the sensor felt: prepare, then solve."""
    target = prepare(
        pressure,
        mapping=settings.mapping,
        grid=settings.grid,
        medium=settings.medium,
        interpolate=settings.interpolate,
        gain=settings.gain,
    )
    solution = solve(
        target,
        array,
        method=settings.method,
        medium=settings.medium,
        directivity=settings.directivity,
        iterations=settings.iterations,
        start=settings.start,
        level=settings.level,
        progress=progress,
    )
    return Reproduction(pressure=pressure, target=target, solution=solution)
