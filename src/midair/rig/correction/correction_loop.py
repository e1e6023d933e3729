"""Play, re-record, correct, play again, compare (paper, 5.2); and again, until it no longer helps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.correct import BeamGain, amplitude_gain, beam_drive, beam_gain, beat_amplitude, commanded_pressure
from midair.devices import ArrayDevice, ExposureChoices, SensorDevice, check_exposure
from midair.errors import InputError
from midair.evaluate import apply_band_twice
from midair.model import Calibration, PressureFrames, Progress, TransducerArray
from midair.pipeline import calibrated_pressure
from midair.rig.correction.first_gain import expected_gain, focus_on_cell, played_part
from midair.rig.correction.iteration import run_iterations
from midair.rig.correction.passes import Pass, Rig, Stage, play_pass, quiet
from midair.rig.playing import rerecord, usual_exposure
from midair.settings import Settings
from midair.targets import led_in, without_lead

MOST = 10.0
"""By how much a first pass is made louder at most by what the model expects: half-wave rectification and the average
over a cell leave a fifth."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamTest:
    """A focus played at several levels on one channel: what was commanded, what was read, and the line through it."""

    channel: int
    commanded: NDArray[np.float64]
    measured: NDArray[np.float64]
    line: BeamGain


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """Everything that came of one loop.

    Attributes
    ----------
    settings : Settings
        Settings of every stage.
    original : PressureFrames
        What was to be reproduced.
    reference : PressureFrames
        The same as a perfect rig would give it back: the original through the band once more. Passes are compared with
        it.
    beam : BeamTest
        The beam test.
    passes : tuple of Pass
        In their order; those that were taken back are not among them.
    taken_back : int
        Steps of the iterative correction that made it worse.
    end : str
        Why the iterative correction stopped; empty when there was none.
    """

    settings: Settings
    original: PressureFrames
    reference: PressureFrames
    beam: BeamTest
    passes: tuple[Pass, ...]
    taken_back: int = 0
    end: str = ""

    def __repr__(self) -> str:
        return f"<Loop of {len(self.passes)} passes, the last {self.passes[-1]!r}>"


def beam_test(
    array: ArrayDevice,
    sensor: SensorDevice,
    calibration: Calibration | None,
    settings: Settings,
    *,
    top: float = 100.0,
    levels: int = 6,
    exposure: ExposureChoices | None = None,
    transducers: TransducerArray | None = None,
    progress: Progress | None = None,
) -> BeamTest:
    """Measure the gain of the beam: a beating focus on the channel nearest to the centre, at several levels.

    It is told on the cell: what the sensor reads over what the model says that a cell reads of the focus, so that it is
    1 on an array that is as strong as assumed.

    Parameters
    ----------
    array, sensor : ArrayDevice, SensorDevice
        Open.
    calibration : Calibration, optional
        Calibration of the sensor.
    settings : Settings
        Its band decides the beat, its grid's height the place; its medium and directivity what is commanded.
    top : float
        Highest pressure that is commanded, in the middle of the focus, in Pa.
    levels : int
        Number of levels, 5 or more, evenly spread in pressure.
    exposure : ExposureChoices, optional
        Limits that the beam has to keep; the usual profile if None.
    transducers : TransducerArray, optional
        The array's as they were measured; the model's if None.
    progress : callable, optional
        Called with (frames played, frames in all).
    """
    frequency, cycles = _beat(settings)
    transducers = transducers or array.array
    channel = (sensor.grid.rows - 1) // 2 * sensor.grid.columns + (sensor.grid.columns - 1) // 2
    point = np.array([*sensor.grid.channel_position(channel), settings.target.grid.height])
    point[:2] += settings.target.grid.centre
    full = float(commanded_pressure(transducers, point, np.ones(1), acoustics=settings.acoustics)[0])
    drives = np.sqrt(np.linspace(1 / levels, 1, levels) * min(top / full, 1.0))
    drive = beam_drive(
        transducers,
        point,
        drives,
        frequency=frequency,
        cycles=cycles,
        rate=settings.target.rate,
        acoustics=settings.acoustics,
    )
    admission = check_exposure(drive, array, exposure or usual_exposure())
    heard = calibrated_pressure(rerecord(admission, array, sensor, progress=progress), calibration, settings)
    signal = heard.pressure.reshape(heard.frames, -1)[: drive.frames, channel]
    measured = beat_amplitude(signal, heard.rate, frequency=frequency, parts=levels)
    # Half peak to peak, which is what `beat_amplitude` reads; of what the cell reads, which is wider than the focus.
    on_cell = focus_on_cell(transducers, sensor.grid, channel, settings) * played_part(frequency, settings)
    commanded = on_cell * drives**2 / 2
    return BeamTest(channel=channel, commanded=commanded, measured=measured, line=beam_gain(commanded, measured))


def run_loop(
    original: PressureFrames,
    array: ArrayDevice,
    sensor: SensorDevice,
    settings: Settings,
    *,
    corrections: int = 1,
    iterate: int = 0,
    exposure: ExposureChoices | None = None,
    lead: float = 0.0,
    measured: TransducerArray | None = None,
    stage: Stage = quiet,
) -> Loop:
    """Take what was felt of an object through the rest of the paper's pipeline on an open array and sensor.

    The first pass is corrected by the beam's gain and by what the model expects that the cells read of it; each further
    one multiplies the pressure by what the pass before it lacked in amplitude. Then come passes that correct the
    waveform, see `rig.iteration`. Passes are compared with the original as a perfect rig would give it back.

    Parameters
    ----------
    original : PressureFrames
        What was felt, in the settings' band and at their rate (`flow.calibrated_pressure`).
    array, sensor, exposure, lead, measured
        As in `Rig`.
    settings : Settings
        Settings of every stage.
    corrections : int
        Passes after the first that correct the amplitude; the paper's loop has one.
    iterate : int
        Largest number of passes after those that correct the waveform.
    stage : callable
        Told the name of each stage as it begins.
    """
    if corrections < 0 or iterate < 0:
        raise InputError(f"corrections: expected 0 or more of each kind, got {corrections} and {iterate}")
    if settings.target.strength is not None:
        raise InputError(
            f"strength: expected none in a loop, which finds the level at which the original comes back, got "
            f"{settings.target.strength:g}; leave it out"
        )
    chosen = exposure or usual_exposure()
    rig = Rig(array=array, sensor=sensor, exposure=chosen, lead=lead, measured=measured)
    progress = stage("beam test")
    beam = beam_test(
        array, sensor, sensor.calibration, settings, exposure=chosen, transducers=measured, progress=progress
    )
    asked = led_in(original, lead)
    # What the model expects of this recording, and what the beam presses of what the model expects.
    expected = expected_gain(original, asked, settings)
    gain = settings.target.gain * amplitude_gain(expected, limit=MOST) * amplitude_gain(beam.line.gain)
    reference = without_lead(apply_band_twice(asked), original.frames)
    passes: list[Pass] = []
    for number in range(corrections + 1):
        if passes:
            # On top of the gain so far: the pass before was played with it.
            gain *= amplitude_gain(passes[-1].comparison.gain)
        passes.append(play_pass(reference, asked, rig, settings.but(gain=gain), f"pass {number + 1}", stage))
    further = run_iterations(reference, passes[-1], rig, settings, iterate, stage=stage)
    return Loop(
        settings=settings,
        original=original,
        reference=reference,
        beam=beam,
        passes=(*passes, *further.passes),
        taken_back=further.taken_back,
        end=further.end,
    )


def _beat(settings: Settings) -> tuple[float, int]:
    """Frequency of the beat in Hz, in the middle of the band on a logarithmic scale, and its cycles at each level."""
    middle = float(np.sqrt(settings.calibration.band[0] * settings.calibration.band[1]))
    # Of at least four frames, as `beam_drive` asks.
    frequency = settings.target.rate / max(4, round(settings.target.rate / middle))
    return frequency, max(4, round(0.2 * frequency))
