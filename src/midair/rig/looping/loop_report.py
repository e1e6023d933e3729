"""The report of a loop: one HTML file that holds everything it shows."""

import base64
import importlib.metadata
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path

import numpy as np

from midair.errors import ShapeError
from midair.evaluate import PalmFidelity, PerceptualCard, perceptual_card, printed_error, relative_error
from midair.figures import (
    beam_figure,
    card_figure,
    error_figure,
    maps_figure,
    passes_figure,
    phase_figure,
    png,
    render_page,
    spectra_figure,
    traces_figure,
)
from midair.files import whole_file
from midair.headroom import level_of
from midair.physics import propagate
from midair.rig.looping.correction_loop import Loop
from midair.settings import Settings
from midair.targets import piece_of

Row = tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure in a report: what it shows, and its PNG."""

    title: str
    caption: str
    data: bytes

    @property
    def source(self) -> str:
        """The picture as a data address, for an ``img`` element."""
        return "data:image/png;base64," + base64.b64encode(self.data).decode()


def write_report(
    loop: Loop, path: Path, *, commands: tuple[str, ...] = (), palm: PalmFidelity | None = None
) -> list[Picture]:
    """Write the report of a loop; the pictures that are in it.

    Parameters
    ----------
    loop : Loop
        What to report.
    path : Path
        Path of the HTML file.
    commands : tuple of str
        With which the same can be done again.
    palm : PalmFidelity, optional
        What a whole palm gets of the last pass, where that was simulated.
    """
    # Drawn once, since that takes longer than solving does.
    shown = [*pictures(loop), *further_pictures(loop, card_of_loop(loop))]
    page = render(loop, shown, commands=commands, palm=palm)
    with whole_file(path) as partial:
        partial.write_text(page, encoding="utf-8")
    return shown


def render(
    loop: Loop, shown: Sequence[Picture], *, commands: tuple[str, ...] = (), palm: PalmFidelity | None = None
) -> str:
    """The report with these pictures as HTML that needs nothing from outside."""
    last, card = loop.passes[-1], card_of_loop(loop)
    name = loop.original.provenance.notes.get("object", loop.original.provenance.source.rpartition(":")[2])
    return render_page(
        "rig/looping/report.html.j2",
        title=f"{name[:1].upper()}{name[1:]}, reproduced in midair",
        simulated=last.comparison.simulated,
        summary=_summary(loop),
        pictures=shown,
        figures=_figures(loop),
        card=() if card is None else card.figures,
        palm={} if palm is None else palm.figures(),
        passes=[f"pass {number + 1}" for number in range(len(loop.passes))],
        rectified=loop.settings.target.mapping == "half-wave",
        settings=settings_rows(loop.settings),
        steps=[(step.stage, _words(step.settings)) for step in last.felt.provenance.steps],
        versions=versions(),
        commands=commands,
    )


def pictures(loop: Loop) -> list[Picture]:
    """Every figure of a loop, in the order of the pipeline."""
    last, simulated = loop.passes[-1], loop.passes[-1].comparison.simulated
    solution, target = last.reproduction.solution, last.reproduction.target
    frame = int(np.argmax(np.linalg.norm(target.amplitude, axis=1)))
    field = np.abs(propagate(solution.drive, target.grid, acoustics=loop.settings.acoustics))
    moment = f"frame {frame}, {frame / target.rate:.3f} s"
    felt_maps = [("original", loop.original), ("re-recorded", last.felt)]
    return [
        Picture(
            title="What the sensor felt, and what it felt of the reproduction",
            caption="Calibrated pressure of every channel, laid out like the sensor's cells, all on one scale.",
            data=png(traces_figure(loop.original, last.felt)),
        ),
        Picture(
            title="Where it pressed",
            caption="Root mean square of the calibrated pressure on each cell.",
            data=png(
                maps_figure(
                    [(name, np.sqrt((frames.pressure**2).mean(axis=0))) for name, frames in felt_maps],
                    loop.original.sensor,
                    quantity="rms pressure (Pa)",
                    simulated=simulated,
                )
            ),
        ),
        Picture(
            title="Target and reproduced field",
            caption=f"Peak sound pressure at the control points in the strongest frame ({moment}), where E is "
            f"{100 * solution.error[frame]:.1f} %. Circles are the sensor's cells.",
            data=png(
                maps_figure(
                    [("target", target.amplitude[frame]), ("reproduced", field[frame])],
                    target.grid,
                    quantity="sound pressure (Pa, peak)",
                    simulated=simulated,
                    sensor=loop.original.sensor,
                )
            ),
        ),
        Picture(
            title="The array",
            caption=f"Phase of each transducer in the same frame ({moment}); all are equally loud.",
            data=png(phase_figure(solution.drive, frame, simulated=simulated)),
        ),
        Picture(
            title="Spectra at the channels that the object passed over",
            caption="After calibration and half-wave rectification, as in the paper's Fig. 9.",
            data=png(spectra_figure([("original", loop.original), ("re-recorded", last.felt)])),
        ),
        Picture(
            title="Error of each frame",
            caption="E = || |Gq| - p || / ||p||. The shaded range is what the paper reports for static patterns.",
            data=png(error_figure(solution, simulated=simulated)),
        ),
        Picture(
            title="Gain of the beam",
            caption=f"A focus that beats at {len(loop.beam.commanded)} levels on channel {loop.beam.channel}: pressure "
            "that the sensor read, over the pressure that the model commanded.",
            data=png(
                beam_figure(
                    loop.beam.commanded,
                    loop.beam.measured,
                    gain=loop.beam.line.gain,
                    intercept=loop.beam.line.intercept,
                    simulated=simulated,
                )
            ),
        ),
    ]


def further_pictures(loop: Loop, card: PerceptualCard | None) -> list[Picture]:
    """What skin makes of it, where it is long enough to tell, and the way there, where there was one."""
    made: list[Picture] = []
    if card is not None:
        made.append(
            Picture(
                title="What skin makes of it, cell by cell",
                caption="The figures of the perceptual card; a dash where the original hardly presses.",
                data=png(card_figure(card)),
            )
        )
    if loop.end:
        errors = [one.comparison.waveform_error for one in loop.passes]
        made.append(
            Picture(
                title="Error of the waveform, pass by pass",
                caption="The first passes correct the amplitude, the others the waveform. "
                f"{loop.taken_back} steps made it worse and were taken back. It ended because {loop.end}.",
                data=png(passes_figure([("this loop", errors)], simulated=loop.passes[-1].comparison.simulated)),
            )
        )
    return made


def card_of_loop(loop: Loop) -> PerceptualCard | None:
    """The perceptual card of the last pass; None where it is shorter than the 64 ms that its metrics need."""
    try:
        return perceptual_card(loop.reference, loop.passes[-1].felt)
    except ShapeError:
        return None


def settings_rows(settings: object, prefix: str = "") -> list[Row]:
    """Every setting with its value, nested ones by a dotted name."""
    rows: list[Row] = []
    if not is_dataclass(settings):
        return rows
    for entry in fields(settings):
        value = getattr(settings, entry.name)
        name = f"{prefix}{entry.name}"
        if is_dataclass(value) and not isinstance(value, type):
            rows += settings_rows(value, f"{name}.")
        else:
            rows.append((name, _word(value)))
    return rows


def versions() -> list[Row]:
    """Versions of midair, Python and the libraries that the figures depend on."""
    libraries = [
        (name, importlib.metadata.version(name)) for name in ("midair", "numpy", "scipy", "h5py", "matplotlib")
    ]
    return [*libraries, ("Python", platform.python_version()), ("system", f"{platform.system()} {platform.machine()}")]


def _summary(loop: Loop) -> str:
    last = loop.passes[-1]
    frames, solution = last.reproduction.target.frames, last.reproduction.solution
    return (
        f"{frames} frames at {last.reproduction.target.rate:g} Hz ({frames / last.reproduction.target.rate:.2f} s) on "
        f"{solution.drive.array.name}, {solution.drive.array.count} transducers, at strength "
        f"{last.reproduction.strength():.2f}. After {len(loop.passes) - 1} correction(s) the re-recorded "
        f"pressure has a correlation of {last.comparison.correlation:.2f} with the original and "
        f"{last.comparison.gain:.2f} times its amplitude. {_level(loop)}"
    )


def _level(loop: Loop) -> str:
    """How hard it was asked to press, what comes of it, and what can be had."""
    made = loop.passes[-1].reproduction
    level = level_of(made.solution, made.target, band=loop.settings.calibration.band)
    said = dict(level.rows())
    return f"Asked for: {said['asked']}. Of that {said['comes']}. Can be had: {said['can be had']}."


def _figures(loop: Loop) -> list[Row]:
    columns = [_pass_figures(loop, number) for number in range(len(loop.passes))]
    return [(name, unit, *(f"{column[name][0]:.3g}" for column in columns)) for name, (_, unit) in columns[0].items()]


def _pass_figures(loop: Loop, number: int) -> Mapping[str, tuple[float, str]]:
    this = loop.passes[number]
    solution, target = this.reproduction.solution, this.reproduction.target
    # Silent frames have no error, and would make the mean better than it is.
    plays = np.array([status != "silent" for status in solution.status])
    # In the lead there is next to nothing to be met, of which any field is far off.
    inside = piece_of(target.provenance, target.frames, target.rate)
    plays[: inside.start] = plays[inside.stop :] = False
    settings: Settings = loop.settings
    field = propagate(solution.drive, target.grid, acoustics=settings.acoustics)
    error = relative_error(field, target.amplitude)[plays]
    return {
        "gain asked for": (this.gain, ""),
        "strength": (this.reproduction.strength(), ""),
        "E of what is met, mean": (100 * float(solution.error[plays].mean()), "%"),
        "E at the control points, mean": (100 * float(error.mean()), "%"),
        "E at the control points, worst frame": (100 * float(error.max()), "%"),
        "E as printed, with 1/M, mean": (100 * float(printed_error(field, target.amplitude)[plays].mean()), "%"),
        "solver iterations, mean": (float(solution.iterations[plays].mean()), ""),
        **this.comparison.figures(),
    }


def _words(settings: Mapping[str, object]) -> str:
    return ", ".join(f"{name} {_word(value)}" for name, value in settings.items() if value not in ((), "", None))


def _word(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return " to ".join(_word(part) for part in value)
    return "default" if value is None else str(value)
