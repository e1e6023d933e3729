"""The report of a loop: one self-contained HTML file with its figures and an interactive view."""

import importlib.metadata
import platform
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from midair.evaluate import (
    ALL,
    ALL_MEASURED,
    PEOPLE,
    RATIOS,
    SAME,
    SIMILAR,
    LaboratoryLoss,
    PerceptualMetrics,
    Verdict,
    printed_error,
    ratio_text,
    relative_error,
    ways_to_play,
)
from midair.figures import (
    Picture,
    beam_figure,
    card_figure,
    error_figure,
    maps_figure,
    passes_figure,
    png_bytes,
    render_page,
    spectra_figure,
    strongest_moment,
    traces_figure,
)
from midair.files import write_file
from midair.model import PressureFrames, Progress, frames_without_lead
from midair.physics import propagate
from midair.rig.correction.correction_loop import Loop
from midair.rig.correction.outcomes import Outcome, comparison_rows, palm_maps
from midair.settings import format_setting
from midair.view import Sound, ViewData, page_parts, show_comparison, show_drive, size_of, with_content_policy

Row = tuple[str, ...]


def write_report(
    loop: Loop,
    path: Path,
    *,
    source: str = "RECORDING",
    commands: tuple[str, ...] = (),
    beside: Sequence[Outcome] = (),
    laboratory: LaboratoryLoss | None = None,
    progress: Progress | None = None,
) -> None:
    """Write the report of a loop as HTML.

    `source` is the name of the recording in commands, `commands` reproduce the result; `beside` holds the outcomes of
    other settings for the same recording, in the order of the page, the loop's own among them; `progress` is called
    with (pictures drawn, total pictures).
    """
    outcomes = tuple(beside) or (Outcome.of(loop),)
    own = next(each for each in outcomes if each.loop is loop)
    loud = own.verdict.excess if own.verdict.excess is not None and own.verdict.excess > 0 else None
    name = loop.original.provenance.notes.get("object", loop.original.provenance.source.rpartition(":")[2])
    watch, life = view_of_loop(loop), loop.passes[-1].felt.provenance
    listen = show_comparison(loop.original, loop.passes[-1].felt, part=_loudest(loop, 1.0))
    page = render_page(
        "rig/correction/report.html.j2",
        watch=watch,
        view=page_parts(watch) | {"sounds": page_parts(listen)["sounds"]},
        title=f"{name[:1].upper()}{name[1:]}, reproduced in midair",
        simulated=loop.passes[-1].comparison.simulated,
        verdict=own.verdict.rows(),
        palm=palm_maps(outcomes),
        trace=_trace(loop),
        laboratory=None if laboratory is None else _laboratory(laboratory),
        bands=[0.0, 0.0] if laboratory is None else [_scale(laboratory) * each for each in (SIMILAR, SAME)],
        ways=() if loud is None else ways_to_play(own.verdict.felt, loud, source=shlex.quote(source)),
        todo=_todo(own.verdict, laboratory, shlex.quote(source)),
        ways_beside=[each.name for each in outcomes] if len(outcomes) > 1 else [],
        side_by_side=[(name, *values, unit) for name, unit, *values in comparison_rows(outcomes)],
        pictures=drawn(loop, own.card, progress),
        figures=[(name, *values, unit) for name, unit, *values in _figures(loop)],
        ratios=[(name, ratio_text(limits), RATIOS[name]) for name, limits in loop.passes[-1].comparison.ratios.items()],
        card=() if own.card is None else own.card.rows(),
        palm_figures=[(name, f"{value:.3g}", unit) for name, (value, unit) in own.palm.figures().items()]
        if own.palm
        else [],
        passes=[f"pass {number + 1}" for number in range(len(loop.passes))],
        rectified=loop.settings.target.mapping == "half-wave",
        settings=[(name, format_setting(name, value)) for name, value in life.last("settings").items()],
        steps=[(step.stage, _settings_text(step.settings)) for step in life.steps if step.stage != "settings"],
        versions=versions(),
        commands=commands,
        people=PEOPLE,
    )
    write_file(path, with_content_policy(page))


def _trace(loop: Loop, window: float = 0.1) -> dict[str, Any]:
    """Curves of the strongest cell around its strongest moment, from 0 to 1000 and downwards from 0 to 100."""
    original, again = loop.original, loop.passes[-1].felt
    window = min(window, original.frames / original.rate)
    cell, begin = strongest_moment(original, window)
    parts = [(each.time >= begin - 1e-9) & (each.time <= begin + window) for each in (original, again)]
    values = [each.pressure[part, *cell] for each, part in zip((original, again), parts, strict=True)]
    low, high = (float(edge([edge(each) for each in values])) for edge in (np.min, np.max))
    high += (high - low or 1.0) * 1e-3
    curves = [
        " ".join(
            f"{1e3 * (time - begin) / window:.1f},{100 * (high - value) / (high - low):.1f}"
            for time, value in zip(each.time[part], own, strict=True)
        )
        for each, part, own in zip((original, again), parts, values, strict=True)
    ]
    steps = (digit * 10.0**power for power in range(-6, 6) for digit in (1, 2, 5))
    step = next(each for each in steps if (high - low) / each < 5)
    ticks = step * np.arange(np.ceil(low / step), high / step)
    return {
        "cell": [number + 1 for number in cell],
        "curves": curves,
        "y": [(100 * (high - each) / (high - low), f"{each:g} Pa") for each in ticks],
        "x": [(100 * share, f"{begin + share * window:.3f} s") for share in (0.0, 0.5, 1.0)],
    }


def _scale(found: LaboratoryLoss) -> float:
    """Per cent of the width of a bar that a dB takes."""
    return 100 / (1.05 * max(found.nominal, SAME + 4, *(high for *_, high in found.rows())))


def _laboratory(found: LaboratoryLoss) -> dict[str, Any]:
    """Bars of what all uncertainties of a laboratory leave, and the table of each."""
    rows = [("ideal", "nothing is out of place", found.nominal, 0.0, 0.0)]
    palm = f"palm height {found.stated.get('palm height', '')}, echo {found.stated.get('echo', '')}"
    units = f"units placed to {found.stated.get('units', '')}"
    names = {ALL_MEASURED: ("array measured", palm), ALL: ("array not measured", f"{units}, {palm}")}
    if found.measured:
        names = {ALL: ("array measured", palm)}
    ranges = {name: limits for name, _, *limits in found.rows()}
    rows += [(*names[name], *ranges[name]) for name in names if name in ranges]
    each = [(name, stated, *(f"{value:.1f}" for value in limits)) for name, stated, *limits in found.rows()]
    return {"rows": rows, "scale": _scale(found), "each": each}


def _todo(verdict: Verdict, laboratory: LaboratoryLoss | None, source: str) -> list[tuple[str, str]]:
    """Return the next steps, each with its command."""
    rows = [("Make it as strong as the original.", f"midair solve {source} {verdict.option}")] if verdict.option else []
    if laboratory is not None:
        rows.append((f"{laboratory.advice[0].upper()}{laboratory.advice[1:]}.", ""))
    if verdict.excess is not None and verdict.excess > 0:
        rows.append(("Choose one of four ways before it is played on a real array.", f"midair play --plan {source}"))
    return [*rows, ("Open it in the browser: listen, change it, play it again.", "midair studio")]


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


def drawn(loop: Loop, card: PerceptualMetrics | None, progress: Progress | None = None) -> list[Picture]:
    """Draw every figure of a loop, those of the pipeline first; `progress` is called with (drawn, total)."""
    count, shown = 6 + (card is not None) + bool(loop.end), list[Picture]()
    for title, caption, curves, figure in _drawings(loop, card):
        shown.append(Picture(title=title, caption=caption, data=png_bytes(figure), lines=curves))
        if progress is not None:
            progress(len(shown), count)
    return shown


def _drawings(loop: Loop, card: PerceptualMetrics | None) -> Iterator[tuple[str, str, bool, Any]]:
    """Title and caption, whether it has curves, and figure of each, in the order of the pipeline."""
    last, simulated = loop.passes[-1], loop.passes[-1].comparison.simulated
    solution, target, beam = last.reproduction.solution, last.reproduction.target, loop.beam
    frame = int(np.argmax(np.linalg.norm(target.amplitude, axis=1)))
    field = np.abs(propagate(solution.drive, target.grid, acoustics=loop.settings.acoustics))
    moment = f"frame {frame}, {frame / target.rate:.3f} s"
    pair = {"original": loop.original, "re-recorded": last.felt}
    yield (
        "Original and re-recorded pressure",
        "Calibrated pressure of every channel, arranged like the sensor's cells, all with the same scale.",
        True,
        traces_figure(loop.original, last.felt),
    )
    maps = [(name, np.sqrt((frames.pressure**2).mean(axis=0))) for name, frames in pair.items()]
    yield (
        "Pressure map",
        "Root mean square of the calibrated pressure on each cell.",
        False,
        maps_figure(maps, loop.original.sensor, quantity="rms pressure (Pa)", simulated=simulated),
    )
    fields, sensor = [("target", target.amplitude[frame]), ("reproduced", field[frame])], loop.original.sensor
    quantity = "sound pressure (Pa, peak)"
    yield (
        "Target and reproduced field",
        f"Peak sound pressure at the control points in the strongest frame ({moment}), where E is "
        f"{100 * solution.error[frame]:.1f} %. Circles are the sensor's cells.",
        False,
        maps_figure(fields, target.grid, quantity=quantity, simulated=simulated, sensor=sensor),
    )
    rectified = loop.settings.target.mapping == "half-wave"
    yield (
        "Spectra of the channels with the highest pressure",
        "After calibration and half-wave rectification, as in the paper's Fig. 9."
        if rectified
        else "After calibration, both signs of the pressure.",
        True,
        spectra_figure({"": pair}, channels=strongest_channels(loop.original), rectified=rectified),
    )
    yield (
        "Error of each frame",
        "E = || |Gq| - p || / ||p||. The shaded range is what the paper reports for static patterns.",
        True,
        error_figure(solution, simulated=simulated),
    )
    line = {"gain": beam.line.gain, "intercept": beam.line.intercept}
    yield (
        "Gain of the beam",
        f"A beating focus at {len(beam.commanded)} levels on channel {beam.channel}: measured pressure over the "
        "pressure commanded by the model.",
        True,
        beam_figure(beam.commanded, beam.measured, **line, simulated=simulated),
    )
    if card is not None:
        dashes = "A dash marks cells where the original has almost no pressure."
        yield "Perceptual metrics of each cell", dashes, False, card_figure(card)
    if loop.end:
        errors = [one.comparison.waveform_error for one in loop.passes]
        yield (
            "Waveform error of each pass",
            "The first passes correct the amplitude, the others the waveform. "
            f"{loop.taken_back} steps increased the error and were taken back. It ended because {loop.end}.",
            True,
            passes_figure([("this loop", errors)], simulated=simulated),
        )


def strongest_channels(original: PressureFrames) -> list[int]:
    """Numbers of the four channels with the greatest root mean square, in ascending order."""
    power = (original.pressure**2).mean(axis=0).ravel()
    return sorted(int(channel) for channel in np.argsort(power)[::-1][:4])


def view_of_loop(loop: Loop, *, most: int = 700_000) -> ViewData:
    """Return the view of the strongest part of a loop, in at most `most` bytes: recording, last drive, re-recording."""
    one = _view(loop, (0.0, 1 / loop.original.rate))
    return _view(loop, _loudest(loop, most / size_of(one) / loop.original.rate))


def _view(loop: Loop, part: tuple[float, float]) -> ViewData:
    return show_comparison(loop.original, loop.passes[-1].felt, sound=_sound(loop, *part), part=part)


def _loudest(loop: Loop, longest: float) -> tuple[float, float]:
    """Start and duration of the strongest part of the original, in s."""
    duration = min(longest, loop.original.frames / loop.original.rate)
    return strongest_moment(loop.original, duration)[1], duration


def _sound(loop: Loop, start: float, seconds: float) -> Sound | None:
    """Sound of the original's part, without its lead; None where its frames differ from the recording's."""
    made = loop.passes[-1].reproduction
    inside = frames_without_lead(made.target.provenance, made.target.frames, made.target.rate)
    same = np.isclose(loop.original.rate, made.target.rate, rtol=1e-9)
    if not same or inside.stop - inside.start != loop.original.frames:
        return None
    return show_drive(made.solution, target=made.target, part=(inside.start / made.target.rate + start, seconds)).sound
