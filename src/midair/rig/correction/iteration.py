"""Iterative correction of the waveform: passes that make up for what the best one so far lacked.

Where the mapping lifts pressure, so that all cells sound all the time, the drive itself is changed as little as can be
(`correct.minimum_norm`); nothing is solved afresh, and what was right stays right. Where it cuts, cells are silent half
of the time and have no slope: there, more is asked for, and solved for (`correct.iterative`).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.correct import IterativeCorrection, MinimumNorm, measured_response
from midair.evaluate import advance
from midair.model import PressureFrames
from midair.physics import SensorModel, cell_weights, focus_amplitude, radiation_pressure
from midair.pipeline import Reproduction
from midair.rig.correction.passes import Pass, Rig, Stage, play_made, play_pass, quiet
from midair.settings import Settings
from midair.targets import precompensate

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IterationResult:
    """What the iterative correction came to.

    Attributes
    ----------
    passes : tuple of Pass
        Each better than the one before it, and the first better than the one it started from.
    taken_back : int
        Steps that made it worse.
    end : str
        Why it stopped; empty when it was not asked for.
    """

    passes: tuple[Pass, ...] = ()
    taken_back: int = 0
    end: str = ""


def run_iterations(
    original: PressureFrames,
    start: Pass,
    rig: Rig,
    settings: Settings,
    times: int,
    *,
    correction: IterativeCorrection | None = None,
    stage: Stage = quiet,
) -> IterationResult:
    """Further passes, each better than the one before it.

    From the best pass so far the response H is measured and what lacks is asked for in addition; or, where the mapping
    lifts, its drive is changed so that it presses what lacks. A step that makes the waveform's error larger is taken
    back, and a smaller one is tried from where it started. It ends after `times` steps, when a step no longer helps, or
    when the steps have become too small.

    Parameters
    ----------
    original : PressureFrames
        What was to be reproduced.
    start : Pass
        The pass to improve on.
    rig : Rig
        Open.
    settings : Settings
        Settings of every stage; the gain is that of `start`.
    times : int
        Largest number of steps, those that are taken back among them; 0 for none.
    correction : IterativeCorrection, optional
        How to step; its defaults if None.
    stage : callable
        Told the name of each stage as it begins.
    """
    lifts = settings.target.mapping != "half-wave"
    correction = correction or (IterativeCorrection(step=1.0) if lifts else IterativeCorrection())
    settings = settings.but(gain=start.gain)
    passes, taken_back, step = [start], 0, correction.step
    end = f"{times} steps were made" if times else ""
    for number in range(1, times + 1):
        best, name, delay = passes[-1], f"correction {number}", start.comparison.delay
        if lifts:
            made = _nudged(original, best, settings, step, delay)
            tried = play_made(original, best.asked, made, rig, settings, name, stage, step=step)
        else:
            asked = _asked(original, best, rig, settings, correction, step, delay)
            tried = play_pass(original, asked, rig, settings, name, stage, step=step)
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
    return IterationResult(passes=tuple(passes[1:]), taken_back=taken_back, end=end)


def _nudged(original: PressureFrames, best: Pass, settings: Settings, step: float, delay: float) -> Reproduction:
    """The best pass's reproduction with a drive that presses what lacked; errors stay those of the solve before."""
    lacking = replace(original, pressure=step * _lacking(original, best, delay))
    chosen, grid = settings.compensation, settings.target.grid
    # What is slower than the band is not changed, and what is played late is not late.
    louder = precompensate(lacking, dynamics=chosen.dynamics, ramp=chosen.ramp)
    weights = cell_weights(SensorModel.usual(original.sensor), grid, centre=grid.centre, between="waves")
    drive = MinimumNorm(dynamics=chosen.dynamics).corrected(
        best.reproduction.solution.drive, louder.pressure.reshape(louder.frames, -1), weights, grid
    )
    return replace(best.reproduction, solution=replace(best.reproduction.solution, drive=drive))


def _lacking(original: PressureFrames, best: Pass, delay: float) -> Array:
    """What the re-recording lacks of the original at the time of each frame that was asked for, in Pa.

    The delay is that of the first pass throughout: found anew each time, it would drift with the correction.
    """
    count = best.asked.frames
    heard = _fitted(advance(best.heard.pressure, delay, original.rate), count)
    first = (count - original.frames) // 2
    part = slice(first, first + original.frames)
    lacking = np.zeros_like(heard)
    # The lead is not judged: nothing lacks there.
    lacking[part] = original.pressure - heard[part]
    return lacking


def _asked(
    original: PressureFrames,
    best: Pass,
    rig: Rig,
    settings: Settings,
    correction: IterativeCorrection,
    step: float,
    delay: float,
) -> PressureFrames:
    """What to ask for next: what the best pass asked for, and what it lacked."""
    focus = focus_amplitude(settings.target.grid, rig.transducers, acoustics=settings.acoustics)
    top = float(radiation_pressure(np.array(focus), settings.acoustics.medium)) / best.gain
    asked, rate = playable(best.asked.pressure, mapping=settings.target.mapping, top=top), original.rate
    heard = _fitted(advance(best.heard.pressure, delay, rate), len(asked))
    lacking = _lacking(original, best, delay)
    response = measured_response(asked, heard, rate, band=settings.calibration.band)
    change = correction.change(lacking, rate, response, band=settings.calibration.band, step=step)
    return replace(
        best.asked,
        pressure=playable(asked + change, mapping=settings.target.mapping, top=top),
        provenance=best.asked.provenance.then("correct", {"step": step, "regularisation": correction.regularisation}),
    )


def playable(asked: Array, *, mapping: str, top: float) -> Array:
    """The nearest pressure that can be asked for, any shape, in Pa.

    Half-wave rectification plays nothing of what is below zero, so asking for it is moot and would only add up; the
    other mappings lift all of it. Nothing is stronger than a single focus of the whole array.
    """
    return np.clip(asked, 0.0 if mapping == "half-wave" else -top, top)


def _fitted(frames: Array, count: int) -> Array:
    """`count` frames: cut, or with silence behind."""
    return np.concatenate([frames[:count], np.zeros((max(0, count - len(frames)), *frames.shape[1:]))])
