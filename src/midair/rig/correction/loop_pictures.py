"""Figures of a loop, in the order of the pipeline."""

from collections.abc import Iterator
from itertools import chain

import numpy as np

from midair.evaluate import PerceptualMetrics
from midair.figures import (
    Picture,
    beam_figure,
    card_figure,
    error_figure,
    maps_figure,
    passes_figure,
    phase_figure,
    png_bytes,
    spectra_figure,
    traces_figure,
)
from midair.model import Drive, PressureFrames, Progress
from midair.physics import propagate
from midair.rig.correction.correction_loop import Loop

FIELD_TITLE = "Target and reproduced field"
"""Title of the picture of the sound field."""


def drawn(loop: Loop, card: PerceptualMetrics | None, progress: Progress | None = None) -> list[Picture]:
    """Draw every figure of a loop, those of the pipeline first; `progress` is called with (drawn, total)."""
    count = 7 + (card is not None) + bool(loop.end)
    shown: list[Picture] = []
    for picture in chain(loop_figures(loop), further_pictures(loop, card)):
        shown.append(picture)
        if progress is not None:
            progress(len(shown), count)
    return shown


def loop_figures(loop: Loop) -> Iterator[Picture]:
    """Draw the figures of a loop, in the order of the pipeline."""
    last, simulated = loop.passes[-1], loop.passes[-1].comparison.simulated
    solution, target = last.reproduction.solution, last.reproduction.target
    frame = int(np.argmax(np.linalg.norm(target.amplitude, axis=1)))
    field = np.abs(propagate(solution.drive, target.grid, acoustics=loop.settings.acoustics))
    moment = f"frame {frame}, {frame / target.rate:.3f} s"
    channels = strongest_channels(loop.original)
    rectified = loop.settings.target.mapping == "half-wave"
    felt_maps = [("original", loop.original), ("re-recorded", last.felt)]
    yield Picture(
        title="Original and re-recorded pressure",
        caption="Calibrated pressure of every channel, arranged like the sensor's cells, all with the same scale.",
        data=png_bytes(traces_figure(loop.original, last.felt)),
    )
    yield Picture(
        title="Pressure map",
        caption="Root mean square of the calibrated pressure on each cell.",
        data=png_bytes(
            maps_figure(
                [(name, np.sqrt((frames.pressure**2).mean(axis=0))) for name, frames in felt_maps],
                loop.original.sensor,
                quantity="rms pressure (Pa)",
                simulated=simulated,
            )
        ),
    )
    yield Picture(
        title=FIELD_TITLE,
        caption=f"Peak sound pressure at the control points in the strongest frame ({moment}), where E is "
        f"{100 * solution.error[frame]:.1f} %. Circles are the sensor's cells.",
        data=png_bytes(
            maps_figure(
                [("target", target.amplitude[frame]), ("reproduced", field[frame])],
                target.grid,
                quantity="sound pressure (Pa, peak)",
                simulated=simulated,
                sensor=loop.original.sensor,
            )
        ),
    )
    yield Picture(
        title="Phases of the array",
        caption=f"Phase of each transducer in the same frame ({moment}); {_level_text(solution.drive, frame)}.",
        data=png_bytes(phase_figure(solution.drive, frame, simulated=simulated)),
    )
    yield Picture(
        title="Spectra of the channels with the highest pressure",
        caption="After calibration and half-wave rectification, as in the paper's Fig. 9."
        if rectified
        else "After calibration, both signs of the pressure.",
        data=png_bytes(
            spectra_figure(
                [("original", loop.original), ("re-recorded", last.felt)], channels=channels, rectified=rectified
            )
        ),
    )
    yield Picture(
        title="Error of each frame",
        caption="E = || |Gq| - p || / ||p||. The shaded range is what the paper reports for static patterns.",
        data=png_bytes(error_figure(solution, simulated=simulated)),
    )
    yield Picture(
        title="Gain of the beam",
        caption=f"A beating focus at {len(loop.beam.commanded)} levels on channel {loop.beam.channel}: measured "
        "pressure over the pressure commanded by the model.",
        data=png_bytes(
            beam_figure(
                loop.beam.commanded,
                loop.beam.measured,
                gain=loop.beam.line.gain,
                intercept=loop.beam.line.intercept,
                simulated=simulated,
            )
        ),
    )


def further_pictures(loop: Loop, card: PerceptualMetrics | None) -> list[Picture]:
    """Draw the perceptual metrics, if the loop is long enough, and the errors of an iterative correction."""
    made: list[Picture] = []
    if card is not None:
        made.append(
            Picture(
                title="Perceptual metrics of each cell",
                caption="A dash marks cells where the original has almost no pressure.",
                data=png_bytes(card_figure(card)),
            )
        )
    if loop.end:
        errors = [one.comparison.waveform_error for one in loop.passes]
        made.append(
            Picture(
                title="Waveform error of each pass",
                caption="The first passes correct the amplitude, the others the waveform. "
                f"{loop.taken_back} steps increased the error and were taken back. It ended because {loop.end}.",
                data=png_bytes(passes_figure([("this loop", errors)], simulated=loop.passes[-1].comparison.simulated)),
            )
        )
    return made


def strongest_channels(original: PressureFrames, most: int = 4) -> list[int]:
    """Numbers of the `most` channels with the greatest root mean square, in ascending order."""
    power = (original.pressure**2).mean(axis=0).ravel()
    return sorted(int(channel) for channel in np.argsort(power)[::-1][:most])


def _level_text(drive: Drive, frame: int) -> str:
    """Describe the range of the transducers' levels."""
    levels = drive.level[frame]
    low, high = float(np.min(levels)), float(np.max(levels))
    return (
        "all have the same level"
        if np.isclose(low, high)
        else f"their levels are {low:.2f} to {high:.2f} of full drive"
    )
