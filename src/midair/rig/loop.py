"""Play, re-record, correct, play again, compare (paper, 5.2)."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.correct import BeamGain, amplitude_gain, beam_drive, beam_gain, beat_amplitude, commanded_pressure
from midair.devices import ArrayDevice, Progress, SensorDevice
from midair.evaluate import Comparison, compare
from midair.flow import Reproduction, Settings, at_rate, felt, reproduce
from midair.model import Calibration, PressureFrames, Recording
from midair.rig.playback import rerecord

Stage = Callable[[str], Progress | None]
"""Told the name of each stage as it begins; gives the progress to report to."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamTest:
    """A focus played at several levels on one channel: what was commanded, what was read, and the line through it."""

    channel: int
    commanded: NDArray[np.float64]
    measured: NDArray[np.float64]
    line: BeamGain


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pass:
    """One time through: the gain that was asked for, what was played, and what the sensor felt of it."""

    gain: float
    reproduction: Reproduction
    rerecorded: Recording
    felt: PressureFrames
    comparison: Comparison


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """Everything that came of one loop: the settings, the original, the beam test, and the passes in their order."""

    settings: Settings
    original: PressureFrames
    beam: BeamTest
    passes: tuple[Pass, ...]


def quiet(_: str) -> Progress | None:
    """A stage reporter that says nothing."""
    return None


def beam_test(
    array: ArrayDevice,
    sensor: SensorDevice,
    calibration: Calibration | None,
    settings: Settings,
    *,
    top: float = 100.0,
    levels: int = 6,
    progress: Progress | None = None,
) -> BeamTest:
    """Measure the gain of the beam: a beating focus on the channel nearest to the centre, at several levels.

    Parameters
    ----------
    array, sensor : ArrayDevice, SensorDevice
        Open.
    calibration : Calibration, optional
        Of the sensor.
    settings : Settings
        Its band decides the beat, its grid's height the place; its medium and directivity what is commanded.
    top : float
        Highest pressure that is commanded, in Pa.
    levels : int
        Number of levels, 5 or more, evenly spread in pressure.
    progress : callable, optional
        Called with (frames played, frames in all).
    """
    frequency, cycles = _beat(settings)
    channel = (sensor.grid.rows - 1) // 2 * sensor.grid.columns + (sensor.grid.columns - 1) // 2
    point = np.array([*sensor.grid.channel_position(channel), settings.grid.height])
    point[:2] += settings.grid.centre
    full = float(
        commanded_pressure(array.array, point, np.ones(1), medium=settings.medium, directivity=settings.directivity)[0]
    )
    drives = np.sqrt(np.linspace(1 / levels, 1, levels) * min(top / full, 1.0))
    drive = beam_drive(
        array.array, point, drives, frequency=frequency, cycles=cycles, rate=settings.rate, medium=settings.medium
    )
    heard = felt(rerecord(drive, array, sensor, progress=progress), calibration, settings)
    signal = heard.pressure.reshape(heard.frames, -1)[: drive.frames, channel]
    measured = beat_amplitude(signal, heard.rate, frequency=frequency, parts=levels)
    commanded = full * drives**2 / 2
    return BeamTest(channel=channel, commanded=commanded, measured=measured, line=beam_gain(commanded, measured))


def run_loop(
    original: PressureFrames,
    array: ArrayDevice,
    sensor: SensorDevice,
    settings: Settings,
    *,
    corrections: int = 1,
    stage: Stage = quiet,
) -> Loop:
    """Take what was felt of an object through the rest of the paper's pipeline on an open array and sensor.

    The first pass is corrected by the beam's gain alone; each further one multiplies the pressure by what the pass
    before it lacked in amplitude.

    Parameters
    ----------
    original : PressureFrames
        What was felt, in the settings' band and at their rate (`flow.felt`).
    array, sensor : ArrayDevice, SensorDevice
        Open; the sensor lies at the settings' control grid and brings its own calibration.
    settings : Settings
        Of every stage.
    corrections : int
        Passes after the first; the paper's loop has one.
    stage : callable
        Told the name of each stage as it begins.
    """
    beam = beam_test(array, sensor, sensor.calibration, settings, progress=stage("beam test"))
    gain = settings.gain * amplitude_gain(beam.line.gain)
    passes: list[Pass] = []
    for number in range(corrections + 1):
        if passes:
            gain *= amplitude_gain(passes[-1].comparison.gain)
        passes.append(_pass(original, array, sensor, replace(settings, gain=gain), number + 1, stage))
    return Loop(settings=settings, original=original, beam=beam, passes=tuple(passes))


def _pass(
    original: PressureFrames, array: ArrayDevice, sensor: SensorDevice, settings: Settings, number: int, stage: Stage
) -> Pass:
    made = reproduce(original, array.array, settings, progress=stage(f"solve, pass {number}"))
    rerecorded = rerecord(made.solution.drive, array, sensor, progress=stage(f"play and re-record, pass {number}"))
    again = at_rate(felt(rerecorded, sensor.calibration, settings), original.rate)
    return Pass(
        gain=settings.gain,
        reproduction=made,
        rerecorded=rerecorded,
        felt=again,
        comparison=compare(original, again),
    )


def _beat(settings: Settings) -> tuple[float, int]:
    """Frequency of the beat in Hz, in the middle of the band on a logarithmic scale, and its cycles at each level."""
    middle = float(np.sqrt(settings.band[0] * settings.band[1]))
    frequency = settings.rate / max(4, round(settings.rate / middle))
    return frequency, max(4, round(0.2 * frequency))
