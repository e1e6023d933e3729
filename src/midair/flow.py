"""The paper on one page: from what the sensor said to what the array is told."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from midair.calibration import calibrate
from midair.dsp import resample
from midair.errors import InputError
from midair.model import (
    AmplitudeFrames,
    Calibration,
    ControlGrid,
    Medium,
    PressureFrames,
    Progress,
    Recording,
    Solution,
    TransducerArray,
)
from midair.physics import Directivity, TransducerDynamics, check_frame_rate, focus_amplitude
from midair.solvers import Amplitudes, Fit, Guard, solve
from midair.targets import Circle, Interpolated, decouple, precompensate, precompensate_sound, prepare


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Everything that can be chosen on the way; the defaults are the paper's.

    Attributes
    ----------
    band : tuple of float
        (low, high) of the frequencies that are kept, in Hz (3).
    rate : float
        Frames per second of the drive, in Hz: the ultrasound's 40 kHz over a whole number (3).
    inverse : {"fft", "fir"}
        How the channels' responses are undone.
    mapping : str
        From signed pressure to pressure that pushes (4.1); "slow-bias" distorts least.
    decouple : bool
        Whether to undo that a cell also feels what is played for its neighbours; the paper did not.
    precompensate : bool
        Whether to undo what holding frames and the transducers' envelope make quieter; the paper did not.
    compensate : {"sound", "pressure"}
        Where: on the sound's amplitude at all frequencies, or on the pressure within 20-480 Hz.
    dynamics : TransducerDynamics
        The envelope that is undone.
    ramp : float
        The silencer's ramp that is undone, in s.
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
    level : float or "auto"
        Drive of every transducer, 0 to 1: the equal amplitude A (4.2); "auto" takes what the loudest frame needs.
    amplitudes : {"equal", "bounded"}
        All transducers at that level, as in the paper; or each at its own up to it.
    guard : Guard or None
        Keeps a ring around the control points quiet; not in the paper.
    fit : {"points", "cells"} or Cells
        Whether the control points are met, as in the paper, or the sensor's cells.
    smooth : float
        Weight of the change of phase from frame to frame; not in the paper.
    backend : str or None
        What does the arithmetic of method "fast"; NumPy if None.
    circle : Circle or None
        Moves the pattern slowly on a circle, for touch below 20 Hz; not in the paper and not validated on people.
    """

    band: tuple[float, float] = (20.0, 470.0)
    rate: float = 1000.0
    inverse: Literal["fft", "fir"] = "fft"
    mapping: str = "half-wave"
    decouple: bool = False
    precompensate: bool = False
    compensate: Literal["sound", "pressure"] = "sound"
    dynamics: TransducerDynamics = field(default_factory=TransducerDynamics)
    ramp: float = 0.0
    interpolate: Interpolated = "amplitude"
    gain: float = 1.0
    grid: ControlGrid = field(default_factory=ControlGrid)
    medium: Medium = field(default_factory=Medium)
    directivity: Directivity = "t4010a1"
    method: str = "lm"
    iterations: int | tuple[int, int] | None = None
    start: Literal["previous", "zero"] = "previous"
    level: float | Literal["auto"] = 1.0
    amplitudes: Amplitudes = "equal"
    guard: Guard | None = None
    fit: Fit = "points"
    smooth: float = 0.0
    backend: str | None = None
    circle: Circle | None = None


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


def to_play(pressure: PressureFrames, settings: Settings) -> PressureFrames:
    """The pressure to be mapped so that this is what presses: decoupled and pre-compensated, as the settings say.

    Pre-compensation of the sound comes later, in `wanted`.
    """
    if settings.decouple:
        pressure = decouple(pressure, grid=settings.grid)
    if settings.precompensate and settings.compensate == "pressure":
        pressure = precompensate(pressure, dynamics=settings.dynamics, ramp=settings.ramp)
    return pressure


def wanted(pressure: PressureFrames, settings: Settings) -> AmplitudeFrames:
    """Sound amplitude at the control points that presses as the sensor felt, all but the solver's part of the way.

    Raises
    ------
    InputError
        If a setting is out of range or unknown.
    """
    if settings.compensate not in ("sound", "pressure"):
        raise InputError(f"compensate: expected sound or pressure, got {settings.compensate!r}")
    target = prepare(
        to_play(pressure, settings),
        mapping=settings.mapping,
        grid=settings.grid,
        medium=settings.medium,
        interpolate=settings.interpolate,
        gain=settings.gain,
        circle=settings.circle,
    )
    if settings.precompensate and settings.compensate == "sound":
        target = precompensate_sound(target, dynamics=settings.dynamics, ramp=settings.ramp)
    return target


def reproduce(
    pressure: PressureFrames, array: TransducerArray, settings: Settings, *, progress: Progress | None = None
) -> Reproduction:
    """The drive with which the array presses as the sensor felt: prepare, then solve.

    Raises
    ------
    RateError
        If the array cannot take frames at the pressure's rate.
    """
    check_frame_rate(pressure.rate, array.frequency)
    target = wanted(pressure, settings)
    solution = solve(
        target,
        array,
        method=settings.method,
        medium=settings.medium,
        directivity=settings.directivity,
        iterations=settings.iterations,
        start=settings.start,
        level=settings.level,
        amplitudes=settings.amplitudes,
        guard=settings.guard,
        fit=settings.fit,
        smooth=settings.smooth,
        backend=settings.backend,
        progress=progress,
    )
    return Reproduction(pressure=pressure, target=target, solution=solution)
