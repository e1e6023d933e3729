"""Iterative correction of the waveform: passes that reduce the remaining error of the best pass so far.

Where the mapping offsets pressure, so that all cells receive sound all the time, the drive itself is changed as little
as possible (`correct.minimum_norm`), without a new solve. Where the mapping rectifies, cells are silent half of the
time and have no slope: there the target is changed and solved again (`correct.iterative`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from midair.array_types import Array
from midair.calibration import known_noise
from midair.correct import IterativeCorrection, measured_response, minimum_norm
from midair.evaluate import Comparison, advance, compare, find_delay
from midair.model import PressureFrames, Progress, Recording
from midair.physics import SensorModel, cell_weights, focus_amplitude, radiation_pressure
from midair.pipeline import Reproduction, calibrated_pressure, reproduce, resample_pressure
from midair.rig.opening import OpenRig
from midair.rig.session import Session
from midair.settings import Settings
from midair.targets import precompensate

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
    made: Reproduction | None = None,
    fixed_place: bool = False,
) -> Pass:
    """Solve for a target, play it, re-record it, and compare with the original as a perfect rig would return it.

    A reproduction that is `made` already is not solved again.
    """
    made = made or reproduce(asked, rig.transducers, settings, progress=stage(f"solve, {name}"))
    progress = stage(f"play and re-record, {name}")
    sensor = rig.listening()
    rerecorded = Session(rig=rig).rerecord(made.solution.drive, progress=progress)
    # A simulated sensor records the drive's first frame at time 0, and was at rest before.
    virtual = sensor.simulated
    heard = resample_pressure(
        calibrated_pressure(rerecorded, sensor.calibration, settings, from_rest=virtual), original.rate
    )
    if not virtual:
        heard = _cut_to_first_frame(heard, asked)
    first, noise = (asked.frames - original.frames) // 2, known_noise(sensor.calibration, settings.calibration.band)
    again = heard if not first else heard.cut(first / heard.rate, original.frames / original.rate)
    return Pass(
        gain=settings.target.gain,
        step=step,
        asked=asked,
        reproduction=made,
        rerecorded=rerecorded,
        heard=heard,
        felt=again,
        comparison=compare(original, heard, first=first, noise=noise, fixed_place=fixed_place),
    )


def _cut_to_first_frame(heard: PressureFrames, asked: PressureFrames) -> PressureFrames:
    """Cut the re-recording to start near the drive's first frame: a real array starts playing with a delay."""
    spare = (heard.frames - asked.frames) / heard.rate
    if spare <= 0:
        return heard
    delay = find_delay(asked.pressure, heard.pressure, heard.rate, longest=spare)
    return heard.cut(max(0.0, delay))


def run_iterations(
    original: PressureFrames,
    start: Pass,
    rig: OpenRig,
    settings: Settings,
    times: int,
    *,
    correction: IterativeCorrection | None = None,
    fixed_place: bool = False,
    stage: Stage = no_progress,
) -> tuple[tuple[Pass, ...], int, str]:
    """Run at most `times` further passes, those taken back included, each with a smaller waveform error.

    Returns the passes, the number of steps that increased the error, and the reason why it stopped, empty without one.
    """
    lifts = settings.target.mapping != "half-wave"
    correction = correction or (IterativeCorrection(step=1.0) if lifts else IterativeCorrection())
    settings = settings.but(gain=start.gain)
    passes, taken_back, step = [start], 0, correction.step
    end = f"{times} steps were made" if times else ""
    for number in range(1, times + 1):
        best, name, delay = passes[-1], f"correction {number}", start.comparison.delay
        if lifts:
            lacking = replace(original, pressure=step * _missing_pressure(original, best, delay))
            chosen, grid = settings.compensation, settings.target.grid
            # Pressure below the band stays unchanged; the delay was removed already.
            louder = precompensate(lacking, dynamics=chosen.dynamics, ramp=chosen.ramp)
            weights = cell_weights(SensorModel.usual(original.sensor), grid, centre=grid.centre, between="waves")
            wanted = louder.pressure.reshape(louder.frames, -1)
            drive = minimum_norm(best.reproduction.solution.drive, wanted, weights, grid, dynamics=chosen.dynamics)
            made = replace(best.reproduction, solution=replace(best.reproduction.solution, drive=drive))
            asked = best.asked
        else:
            made, asked = None, _next_target(original, best, rig, settings, correction, step, delay)
        tried = play_pass(original, asked, rig, settings, name, stage, step=step, made=made, fixed_place=fixed_place)
        before, after = (each.comparison.waveform_error for each in (passes[-1], tried))
        if after >= before:
            taken_back, step = taken_back + 1, step * correction.shrink
            if step < correction.smallest:
                end = "no step makes it better"
                break
            continue
        passes.append(tried)
        if after > (1 - correction.least) * before:
            end = f"the last step lowered the error by less than {100 * correction.least:g} %"
            break
    return tuple(passes[1:]), taken_back, end


def _missing_pressure(original: PressureFrames, best: Pass, delay: float) -> Array:
    """Missing pressure in Pa (original minus re-recording) at each frame of the target."""
    count = best.asked.frames
    # The delay is that of the first pass: estimated anew each time, it would drift with the correction.
    heard = _with_length(advance(best.heard.pressure, delay, original.rate), count)
    first = (count - original.frames) // 2
    part = slice(first, first + original.frames)
    lacking = np.zeros_like(heard)
    # The lead is not compared, so nothing is missing there.
    lacking[part] = original.pressure - heard[part]
    return lacking


def _next_target(
    original: PressureFrames,
    best: Pass,
    rig: OpenRig,
    settings: Settings,
    correction: IterativeCorrection,
    step: float,
    delay: float,
) -> PressureFrames:
    focus = focus_amplitude(settings.target.grid, rig.transducers, acoustics=settings.acoustics)
    top = float(radiation_pressure(np.array(focus), settings.acoustics.medium)) / best.gain
    asked, rate = playable(best.asked.pressure, mapping=settings.target.mapping, top=top), original.rate
    heard = _with_length(advance(best.heard.pressure, delay, rate), len(asked))
    lacking = _missing_pressure(original, best, delay)
    response = measured_response(asked, heard, rate, band=settings.calibration.band)
    change = correction.change(lacking, rate, response, band=settings.calibration.band, step=step)
    return replace(
        best.asked,
        pressure=playable(asked + change, mapping=settings.target.mapping, top=top),
        provenance=best.asked.provenance.then("correct", {"step": step, "regularisation": correction.regularisation}),
    )


def playable(asked: Array, *, mapping: str, top: float) -> Array:
    """Nearest pressure that can be played, up to `top` Pa, a single focus of the whole array."""
    # Half-wave rectification plays nothing below zero, so a negative target would only accumulate.
    return np.clip(asked, 0.0 if mapping == "half-wave" else -top, top)


def _with_length(frames: Array, count: int) -> Array:
    """Return `count` frames, cut or padded with silence."""
    return np.concatenate([frames[:count], np.zeros((max(0, count - len(frames)), *frames.shape[1:]))])
