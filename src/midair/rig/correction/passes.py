"""One pass of the loop: solve, play, re-record, compare."""

from collections.abc import Callable
from dataclasses import dataclass

from midair.calibration import known_noise
from midair.devices import check_exposure
from midair.evaluate import Comparison, compare, find_delay
from midair.model import PressureFrames, Progress, Recording
from midair.pipeline import Reproduction, calibrated_pressure, reproduce, resample_pressure
from midair.rig.opening import OpenRig
from midair.rig.playing import rerecord
from midair.settings import Settings

Stage = Callable[[str], Progress | None]
"""Called with the name of a stage at its start; returns the stage's progress callback or None."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pass:
    """Result of one pass."""

    gain: float
    """Factor that multiplied the pressure."""
    step: float | None
    """Step size g of an iterative correction; None if only the gain was corrected."""
    asked: PressureFrames
    """Target pressure before the gain, with the lead on both sides."""
    reproduction: Reproduction
    rerecorded: Recording
    """The re-recorded signal."""
    heard: PressureFrames
    """The same, calibrated, from the drive's first frame, with the lead."""
    felt: PressureFrames
    """The part of `heard` that corresponds to the original."""
    comparison: Comparison
    """Comparison of that part with the original."""

    def __repr__(self) -> str:
        return f"<Pass at gain {self.gain:.3g}, {self.comparison!r}>"


def no_progress(_: str) -> Progress | None:
    """Stage callback that reports nothing."""
    return None


def play_pass(
    original: PressureFrames,
    asked: PressureFrames,
    rig: OpenRig,
    settings: Settings,
    name: str,
    stage: Stage,
    *,
    step: float | None = None,
) -> Pass:
    """Solve for a target, play it, re-record it, and compare with the original as a perfect rig would return it."""
    made = reproduce(asked, rig.transducers, settings, progress=stage(f"solve, {name}"))
    return play_made(original, asked, made, rig, settings, name, stage, step=step)


def play_made(
    original: PressureFrames,
    asked: PressureFrames,
    made: Reproduction,
    rig: OpenRig,
    settings: Settings,
    name: str,
    stage: Stage,
    *,
    step: float | None = None,
) -> Pass:
    """Do the same with an existing reproduction."""
    progress = stage(f"play and re-record, {name}")
    admission = check_exposure(made.solution.drive, rig.array, rig.exposure)
    sensor = rig.listening()
    rerecorded = rerecord(admission, rig.array, sensor, progress=progress, room=rig.exposure.room)
    # A simulated sensor records the drive's first frame at time 0, and was at rest before.
    virtual = sensor.simulated
    heard = resample_pressure(
        calibrated_pressure(rerecorded, sensor.calibration, settings, from_rest=virtual), original.rate
    )
    if not virtual:
        heard = _cut_to_first_frame(heard, asked)
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
        comparison=compare(
            original, heard, first=first, noise=known_noise(sensor.calibration, settings.calibration.band)
        ),
    )


def _cut_to_first_frame(heard: PressureFrames, asked: PressureFrames) -> PressureFrames:
    """Cut the re-recording to start near the drive's first frame: a real array starts playing with a delay."""
    spare = (heard.frames - asked.frames) / heard.rate
    if spare <= 0:
        return heard
    delay = find_delay(asked.pressure, heard.pressure, heard.rate, longest=spare)
    return heard.cut(max(0.0, delay))
