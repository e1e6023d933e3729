"""The report of a loop: one self-contained HTML file with its figures and an interactive view."""

import importlib.metadata
import platform
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from midair.evaluate import (
    RATIOS,
    LaboratoryLoss,
    PerceptualMetrics,
    printed_error,
    ratio_text,
    relative_error,
)
from midair.figures import (
    Picture,
    beam_figure,
    card_figure,
    error_figure,
    maps_figure,
    passes_figure,
    phase_figure,
    png_bytes,
    render_page,
    spectra_figure,
    traces_figure,
)
from midair.files import write_file
from midair.model import Drive, PressureFrames, Progress
from midair.physics import propagate
from midair.rig.correction.correction_loop import Loop
from midair.rig.correction.laboratory import laboratory_picture
from midair.rig.correction.outcomes import Outcome, comparison_rows, palm_picture
from midair.settings import format_setting
from midair.targets import frames_without_lead
from midair.view import Sound, ViewData, page_parts, show_comparison, show_drive, with_content_policy

Row = tuple[str, ...]


def write_report(
    loop: Loop,
    path: Path,
    *,
    commands: tuple[str, ...] = (),
    beside: Sequence[Outcome] = (),
    laboratory: LaboratoryLoss | None = None,
    progress: Progress | None = None,
) -> list[Picture]:
    """Write the report of a loop as HTML, and return its figures in order.

    `commands` reproduce the result; `beside` holds the outcomes of other settings for the same recording, in the order
    of the page, the loop's own among them; `progress` is called with (pictures drawn, total pictures).
    """
    outcomes = tuple(beside) or (Outcome.of(loop),)
    own = next(each for each in outcomes if each.loop is loop)
    # Drawn once, since drawing takes longer than solving.
    shown = drawn(loop, own.card, progress)
    palms = [] if (pressed := palm_picture(outcomes)) is None else [pressed]
    palms += [] if laboratory is None else [laboratory_picture(laboratory)]
    name = loop.original.provenance.notes.get("object", loop.original.provenance.source.rpartition(":")[2])
    watch, life = view_of_loop(loop), loop.passes[-1].felt.provenance
    page = render_page(
        "rig/correction/report.html.j2",
        watch=watch,
        view=page_parts(watch),
        title=f"{name[:1].upper()}{name[1:]}, reproduced in midair",
        simulated=loop.passes[-1].comparison.simulated,
        verdict=outcomes[0].verdict.rows(),
        palms=palms,
        ways=[each.name for each in outcomes] if len(outcomes) > 1 else [],
        side_by_side=comparison_rows(outcomes),
        pictures=shown,
        figures=_figures(loop),
        ratios=[(name, ratio_text(limits), RATIOS[name]) for name, limits in loop.passes[-1].comparison.ratios.items()],
        card=() if own.card is None else own.card.rows(),
        palm={} if own.palm is None else own.palm.figures(),
        passes=[f"pass {number + 1}" for number in range(len(loop.passes))],
        rectified=loop.settings.target.mapping == "half-wave",
        settings=[(name, format_setting(name, value)) for name, value in life.last("settings").items()],
        steps=[(step.stage, _settings_text(step.settings)) for step in life.steps if step.stage != "settings"],
        versions=versions(),
        commands=commands,
    )
    write_file(path, with_content_policy(page))
    return [*palms, *shown]


def versions() -> list[Row]:
    """Versions of midair, Python and the libraries that affect the results."""
    libraries = [
        (name, importlib.metadata.version(name)) for name in ("midair", "numpy", "scipy", "h5py", "matplotlib")
    ]
    return [*libraries, ("Python", platform.python_version()), ("system", f"{platform.system()} {platform.machine()}")]


def _figures(loop: Loop) -> list[Row]:
    columns = [_pass_figures(loop, number) for number in range(len(loop.passes))]
    return [(name, unit, *(f"{column[name][0]:.3g}" for column in columns)) for name, (_, unit) in columns[0].items()]


def _pass_figures(loop: Loop, number: int) -> Mapping[str, tuple[float, str]]:
    this = loop.passes[number]
    solution, target = this.reproduction.solution, this.reproduction.target
    # Silent frames have no error and would bias the mean.
    plays = solution.plays
    # In the lead the target is almost zero, so the relative error there has no meaning.
    inside = frames_without_lead(target.provenance, target.frames, target.rate)
    plays[: inside.start] = plays[inside.stop :] = False
    field = propagate(solution.drive, target.grid, acoustics=loop.settings.acoustics)
    error = relative_error(field, target.amplitude)[plays]
    return {
        "gain requested": (this.gain, ""),
        "strength": (this.reproduction.strength(), ""),
        "E as the solver measures it, mean": (100 * float(solution.error[plays].mean()), "%"),
        "E at the control points, mean": (100 * float(error.mean()), "%"),
        "E at the control points, worst frame": (100 * float(error.max()), "%"),
        "E as printed, with 1/M, mean": (100 * float(printed_error(field, target.amplitude)[plays].mean()), "%"),
        "solver iterations, mean": (float(solution.iterations[plays].mean()), ""),
        **this.comparison.figures(),
    }


def _settings_text(settings: Mapping[str, object]) -> str:
    return ", ".join(f"{name} {_value_text(value)}" for name, value in settings.items() if value not in ((), "", None))


def _value_text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return " to ".join(_value_text(part) for part in value)
    return "default" if value is None else str(value)


FIELD_TITLE = "Target and reproduced field"
"""Title of the picture of the sound field."""


def drawn(loop: Loop, card: PerceptualMetrics | None, progress: Progress | None = None) -> list[Picture]:
    """Draw every figure of a loop, those of the pipeline first; `progress` is called with (drawn, total)."""
    count, shown = 7 + (card is not None) + bool(loop.end), list[Picture]()
    for picture in _pictures(loop, card):
        shown.append(picture)
        if progress is not None:
            progress(len(shown), count)
    return shown


def _pictures(loop: Loop, card: PerceptualMetrics | None) -> Iterator[Picture]:
    """Draw the figures in the order of the pipeline; then the perceptual metrics, and errors of iterative passes."""
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
        lines=True,
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
        lines=True,
        caption="After calibration and half-wave rectification, as in the paper's Fig. 9."
        if rectified
        else "After calibration, both signs of the pressure.",
        data=png_bytes(
            spectra_figure(
                {"": {"original": loop.original, "re-recorded": last.felt}}, channels=channels, rectified=rectified
            )
        ),
    )
    yield Picture(
        title="Error of each frame",
        caption="E = || |Gq| - p || / ||p||. The shaded range is what the paper reports for static patterns.",
        data=png_bytes(error_figure(solution, simulated=simulated)),
        lines=True,
    )
    yield Picture(
        title="Gain of the beam",
        lines=True,
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
    if card is not None:
        yield Picture(
            title="Perceptual metrics of each cell",
            caption="A dash marks cells where the original has almost no pressure.",
            data=png_bytes(card_figure(card)),
        )
    if loop.end:
        errors = [one.comparison.waveform_error for one in loop.passes]
        yield Picture(
            title="Waveform error of each pass",
            lines=True,
            caption="The first passes correct the amplitude, the others the waveform. "
            f"{loop.taken_back} steps increased the error and were taken back. It ended because {loop.end}.",
            data=png_bytes(passes_figure([("this loop", errors)], simulated=simulated)),
        )


def strongest_channels(original: PressureFrames) -> list[int]:
    """Numbers of the four channels with the greatest root mean square, in ascending order."""
    power = (original.pressure**2).mean(axis=0).ravel()
    return sorted(int(channel) for channel in np.argsort(power)[::-1][:4])


def _level_text(drive: Drive, frame: int) -> str:
    levels = drive.level[frame]
    low, high = float(np.min(levels)), float(np.max(levels))
    return (
        "all have the same level"
        if np.isclose(low, high)
        else f"their levels are {low:.2f} to {high:.2f} of full drive"
    )


LONGEST = 4000
"""Maximum number of frames in the view of a report, about 6 MB."""


def view_of_loop(loop: Loop, *, longest: int = LONGEST) -> ViewData:
    """Return the view of the beginning of a loop: recording, last drive and re-recording."""
    last = loop.passes[-1]
    seconds = min(longest, loop.original.frames) / loop.original.rate
    return show_comparison(loop.original, last.felt, sound=_sound(loop, seconds), part=(0.0, seconds))


def _sound(loop: Loop, seconds: float) -> Sound | None:
    """Sound of the original's part, without its lead; None where its frames differ from the recording's."""
    made = loop.passes[-1].reproduction
    inside = frames_without_lead(made.target.provenance, made.target.frames, made.target.rate)
    same = np.isclose(loop.original.rate, made.target.rate, rtol=1e-9)
    if not same or inside.stop - inside.start != loop.original.frames:
        return None
    return show_drive(made.solution, target=made.target, part=(inside.start / made.target.rate, seconds)).sound
