"""One time through: solve, play, re-record, compare."""

from collections.abc import Callable
from dataclasses import dataclass, field

from midair.devices import ArrayDevice, ExposureChoices, SensorDevice, check_exposure
from midair.errors import InputError
from midair.evaluate import Comparison, compare, find_delay
from midair.model import PressureFrames, Progress, Recording, TransducerArray
from midair.pipeline import Reproduction, at_rate, calibrated_pressure, reproduce
from midair.rig.playing import rerecord, usual_exposure
from midair.settings import Settings

Stage = Callable[[str], Progress | None]
"""Told the name of each stage as it begins; gives the progress to report to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """What a loop plays on.

    Attributes
    ----------
    array, sensor : ArrayDevice, SensorDevice
        Open; the sensor lies at the settings' control grid and brings its own calibration.
    exposure : ExposureChoices
        Limits that every drive has to keep on an array that can be heard.
    lead : float
        Silence that swells into the original before it and fades after it, in s, so that a bias has time to rise.
    measured : TransducerArray or None
        The array's transducers as they were measured, to be solved for; None takes the model's.
    """

    array: ArrayDevice
    sensor: SensorDevice
    exposure: ExposureChoices = field(default_factory=usual_exposure)
    lead: float = 0.0
    measured: TransducerArray | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.lead < 10:
            raise InputError(f"lead: expected 0 to 10 s, got {self.lead:g} s")

    @property
    def transducers(self) -> TransducerArray:
        """What is solved for."""
        return self.measured or self.array.array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pass:
    """What one time through solving, playing and re-recording gave.

    Attributes
    ----------
    gain : float
        Factor that the pressure was multiplied by.
    step : float or None
        g of an iterative correction; None of a pass that the gain alone corrects.
    asked : PressureFrames
        The pressure that was asked for, before the gain, with the lead on both sides.
    reproduction : Reproduction
        What was played.
    rerecorded : Recording
        What came back.
    heard : PressureFrames
        The same calibrated, from the drive's first frame on, with the lead.
    felt : PressureFrames
        The part of it that the original is of.
    comparison : Comparison
        Comparison of that part with the original.
    """

    gain: float
    step: float | None
    asked: PressureFrames
    reproduction: Reproduction
    rerecorded: Recording
    heard: PressureFrames
    felt: PressureFrames
    comparison: Comparison

    def __repr__(self) -> str:
        return f"<Pass at gain {self.gain:.3g}, {self.comparison!r}>"


def quiet(_: str) -> Progress | None:
    """A stage reporter that says nothing."""
    return None


def play_pass(
    original: PressureFrames,
    asked: PressureFrames,
    rig: Rig,
    settings: Settings,
    name: str,
    stage: Stage,
    *,
    step: float | None = None,
) -> Pass:
    """Solve for what is asked, play it, re-record it, and compare with the original as a perfect rig would give it."""
    made = reproduce(asked, rig.transducers, settings, progress=stage(f"solve, {name}"))
    return play_made(original, asked, made, rig, settings, name, stage, step=step)


def play_made(
    original: PressureFrames,
    asked: PressureFrames,
    made: Reproduction,
    rig: Rig,
    settings: Settings,
    name: str,
    stage: Stage,
    *,
    step: float | None = None,
) -> Pass:
    """The same with a drive that is made already."""
    progress = stage(f"play and re-record, {name}")
    admission = check_exposure(made.solution.drive, rig.array, rig.exposure)
    rerecorded = rerecord(admission, rig.array, rig.sensor, progress=progress)
    # A simulated sensor hears the drive's first frame at time 0, and has been at rest until then.
    virtual = rig.sensor.simulated
    heard = at_rate(calibrated_pressure(rerecorded, rig.sensor.calibration, settings, from_rest=virtual), original.rate)
    if not virtual:
        heard = _from_the_first_frame(heard, asked)
    first = (asked.frames - original.frames) // 2
    again = heard if not first else heard.cut(first / heard.rate, original.frames / original.rate)
    return Pass(
        gain=settings.target.gain,
        step=step,
        asked=asked,
        reproduction=made,
        rerecorded=rerecorded,
        heard=heard,
        felt=again,
        comparison=compare(original, heard, first=first),
    )


def _from_the_first_frame(heard: PressureFrames, asked: PressureFrames) -> PressureFrames:
    """What was heard from about the drive's first frame on: a real array begins to play when it is ready."""
    spare = (heard.frames - asked.frames) / heard.rate
    if spare <= 0:
        return heard
    delay = find_delay(asked.pressure, heard.pressure, heard.rate, longest=spare)
    return heard.cut(max(0.0, delay))
