"""The report of a loop: one self-contained HTML file."""

import importlib.metadata
import platform
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

from midair.evaluate import PalmFidelity, printed_error, relative_error
from midair.figures import Picture, render_page
from midair.files import atomic_file
from midair.headroom import level_of
from midair.model import Progress
from midair.physics import propagate
from midair.rig.correction.correction_loop import Loop
from midair.rig.correction.loop_pictures import drawn
from midair.rig.correction.loop_view import view_of_loop
from midair.rig.correction.outcomes import Outcome, comparison_rows, palm_picture, summarise_outcomes
from midair.settings import Settings, format_setting
from midair.targets import frames_without_lead
from midair.view import page_parts, with_content_policy

Row = tuple[str, ...]


def write_report(
    loop: Loop,
    path: Path,
    *,
    commands: tuple[str, ...] = (),
    palm: PalmFidelity | None = None,
    beside: Sequence[Outcome] = (),
    progress: Progress | None = None,
) -> list[Picture]:
    """Write the report of a loop, and return its figures in order.

    Parameters
    ----------
    path : Path
        Path of the HTML file.
    commands : tuple of str
        Commands that reproduce the result.
    palm : PalmFidelity, optional
        Fidelity of the last pass on a simulated palm.
    beside : sequence of Outcome
        Outcomes of other settings for the same recording, in the order of the page; the loop's own among them.
    progress : callable, optional
        Called with (pictures drawn, total pictures).
    """
    outcomes = tuple(beside) or (Outcome.of(loop, palm=palm),)
    # Drawn once, since drawing takes longer than solving.
    own = next(each for each in outcomes if each.loop is loop)
    shown = drawn(loop, own.card, progress)
    palms = [] if (pressed := palm_picture(outcomes)) is None else [pressed]
    page = render(loop, shown, commands=commands, outcomes=outcomes, palms=palms)
    with atomic_file(path) as partial:
        partial.write_text(page, encoding="utf-8")
    return [*palms, *shown]


def render(
    loop: Loop,
    shown: Sequence[Picture],
    *,
    commands: tuple[str, ...] = (),
    outcomes: Sequence[Outcome] = (),
    palms: Sequence[Picture] = (),
) -> str:
    """Render the report as HTML without external resources."""
    outcomes = tuple(outcomes) or (Outcome.of(loop),)
    own = next(each for each in outcomes if each.loop is loop)
    name = loop.original.provenance.notes.get("object", loop.original.provenance.source.rpartition(":")[2])
    watch = view_of_loop(loop)
    page = render_page(
        "rig/correction/report.html.j2",
        watch=watch,
        view=page_parts(watch),
        title=f"{name[:1].upper()}{name[1:]}, reproduced in midair",
        simulated=loop.passes[-1].comparison.simulated,
        verdict=summarise_outcomes(outcomes),
        summary=_summary(loop),
        palms=palms,
        ways=[each.name for each in outcomes] if len(outcomes) > 1 else [],
        side_by_side=comparison_rows(outcomes),
        pictures=shown,
        figures=_figures(loop),
        card=() if own.card is None else own.card.figures,
        palm={} if own.palm is None else own.palm.figures(),
        passes=[f"pass {number + 1}" for number in range(len(loop.passes))],
        rectified=loop.settings.target.mapping == "half-wave",
        settings=settings_rows(loop.settings),
        steps=[(step.stage, _settings_text(step.settings)) for step in loop.passes[-1].felt.provenance.steps],
        versions=versions(),
        commands=commands,
    )
    return with_content_policy(page)


def settings_rows(settings: object, prefix: str = "") -> list[Row]:
    """Every setting with its value; nested settings have dotted names."""
    rows: list[Row] = []
    if not is_dataclass(settings):
        return rows
    for entry in fields(settings):
        value = getattr(settings, entry.name)
        name = f"{prefix}{entry.name}"
        if is_dataclass(value) and not isinstance(value, type):
            rows += settings_rows(value, f"{name}.")
        else:
            rows.append((name, format_setting(name, value)))
    return rows


def versions() -> list[Row]:
    """Versions of midair, Python and the libraries that affect the results."""
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
        f"{last.reproduction.strength():.2f}. After {len(loop.passes) - 1} correction(s), the re-recorded "
        f"pressure has a correlation of {last.comparison.correlation:.2f} with the original and "
        f"{last.comparison.gain:.2f} times its amplitude. {_level(loop)}"
    )


def _level(loop: Loop) -> str:
    """Describe the requested strength, the resulting pressure, and the largest possible pressure."""
    made = loop.passes[-1].reproduction
    level = level_of(made.solution, made.target, band=loop.settings.calibration.band)
    said = dict(level.rows())
    return f"Requested: {said['asked']}. Result: {said['comes']}. Possible: {said['can be had']}."


def _figures(loop: Loop) -> list[Row]:
    columns = [_pass_figures(loop, number) for number in range(len(loop.passes))]
    return [(name, unit, *(f"{column[name][0]:.3g}" for column in columns)) for name, (_, unit) in columns[0].items()]


def _pass_figures(loop: Loop, number: int) -> Mapping[str, tuple[float, str]]:
    this = loop.passes[number]
    solution, target = this.reproduction.solution, this.reproduction.target
    # Silent frames have no error and would bias the mean.
    plays = np.array([status != "silent" for status in solution.status])
    # In the lead the target is almost zero, so the relative error there has no meaning.
    inside = frames_without_lead(target.provenance, target.frames, target.rate)
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


def _settings_text(settings: Mapping[str, object]) -> str:
    return ", ".join(f"{name} {_value_text(value)}" for name, value in settings.items() if value not in ((), "", None))


def _value_text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return " to ".join(_value_text(part) for part in value)
    return "default" if value is None else str(value)
