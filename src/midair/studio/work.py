"""Functions that run in the worker process: solve, compare, report, make samples and studies."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from midair.errors import InputError
from midair.evaluate import RATIOS, Verdict, compare, metrics_or_none, ratio_text
from midair.files import load_solution
from midair.model import PressureFrames, TransducerArray
from midair.pipeline import required_lead
from midair.rig import (
    BudgetPlan,
    VirtualRig,
    aligned_pair,
    array_calibration_for,
    calibrated_take,
    error_budget,
    next_step,
    original_of_drive,
    palm_of_drive,
    pressure_of,
    pressure_to_solve,
    record,
    solve_to_file,
)
from midair.settings import MODES, Mode, Settings
from midair.solvers import METHODS, takes
from midair.studio.jobs import Progressed
from midair.studio.solved_sample import SOLVED, write_sample
from midair.studio.take_data import describe_settings, page_rows, stamp_of
from midair.study import StudyFolder, Template, prepare_drives, read_design, template_text


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveRequest:
    """Paths and settings of one solve."""

    take: str
    """Path of the recording."""
    drive: str
    """Path of the drive to write."""
    mode: Mode = "paper"
    choices: tuple[tuple[str, Any], ...] = ()
    """Names and values of settings that differ from those of the mode."""
    device: str = "virtual"
    """Array on which the drive will be played."""
    array_calibration: Path | None = None
    """As in `StudioPlan`."""
    start: float = 0.0
    """Start in s of the part to solve."""
    duration: float | None = None
    """Length in s of the part to solve; the whole take if None."""
    replaces: str = ""
    """Stamp of the drive that may be replaced; empty if no drive may exist."""
    outdated: tuple[tuple[str, str], ...] = ()
    """Paths and stamps of files made from the replaced drive, which are removed with it."""


def settings_of(order: SolveRequest) -> Settings:
    """Return the settings of a request; InputError if one is unknown, out of range or not taken by the solver."""
    settings = MODES[order.mode]()
    settings = settings.but(**{name.replace("-", "_"): value for name, value in order.choices})
    settings.solver.check()
    return settings


def led_pressure(order: SolveRequest) -> tuple[TransducerArray, Settings, PressureFrames]:
    """Array, settings, and pressure with its lead, of a request."""
    settings, array = settings_of(order), TransducerArray.autd3()
    led = pressure_to_solve(order.take, settings, order.start, order.duration)
    if (kept := array_calibration_for(order.device, order.array_calibration)) is not None:
        array, settings, led = kept.applied(array, settings, led)
    return array, settings, led


def solve_take(order: SolveRequest, progress: Progressed) -> None:
    """Solve a take and write its drive."""
    progress("reading the take", 0, 1)
    array, settings, led = led_pressure(order)
    drive = Path(order.drive)

    def confirm() -> None:
        # A command or another studio may have written a drive in the minutes since the request.
        if stamp_of(drive) != order.replaces:
            found = "another one" if drive.exists() else "none"
            expected = "the drive that was to be replaced" if order.replaces else "no drive of this name"
            raise InputError(f"{drive.name}: expected {expected}, found {found} since; it was not changed, solve again")

    solve_to_file(led, array, settings, drive, progress=partial(progress, "solving"), confirm=confirm)
    for path, stamp in order.outdated:
        if stamp_of(path) == stamp:
            Path(path).unlink(missing_ok=True)


def compare_takes(order: tuple[str, str, str, str], progress: Progressed) -> dict[str, Any]:
    """Compare a re-recording with its original: figures, perceptual metrics, and a gain that corrects the level."""
    original, again, kept, drive = order
    stamp = stamp_of(drive)
    progress("comparing", 0, 3)
    take = calibrated_take(again)
    settings = Settings.of(take.recording.provenance) or Settings()
    pair = aligned_pair(pressure_of(original, settings), take, settings)
    before, after = pair.original, pair.piece
    progress("comparing", 1, 3)
    found = compare(before, pair.heard, first=pair.first, noise=pair.noise)
    card = metrics_or_none(before, after)
    rows = [] if card is None else card.rows()
    progress("comparing", 2, 3)
    partial = Path(kept).with_suffix(".partial.npz")
    np.savez(partial, rate=before.rate, original=before.pressure, again=after.pressure)
    partial.replace(kept)
    spectrum = _spectra(before, after)
    gain = settings.target.gain / found.gain if found.gain > 0.05 else None
    if stamp:
        # The provenance of a re-recording begins with that of its drive.
        steps = load_solution(drive, streamed=True).drive.provenance.steps
        stamp = stamp if take.recording.provenance.steps[: len(steps)] == steps else ""
    return {
        "kept": kept,
        "drive": stamp,
        "simulated": found.simulated,
        "figures": [
            *([name, f"{ratio_text(limits)} dB"] for name, limits in found.ratios.items()),
            *([name, _figure(*figure)] for name, figure in found.figures().items() if name not in RATIOS),
        ],
        "verdict": page_rows(Verdict.of(found, after, card, option=next_step(found.gain, settings)).rows()),
        "card": [[name, f"{value} {unit}".rstrip(), meaning] for name, value, unit, meaning in rows],
        "channel_correlation": np.round(found.channel_correlation, 3).ravel().tolist(),
        "rate_hz": before.rate,
        "frames": before.frames,
        "spectrum": spectrum,
        "gain": settings.target.gain,
        "mode": describe_settings(settings)["mode"],
        "suggested_gain": None if gain is None else float(f"{gain:.4g}"),
        "measured_gain": float(found.gain),
    }


def palm_of_take(order: tuple[str, str], progress: Progressed) -> dict[str, Any]:
    """Simulate the pressure of a drive on an 85 mm palm on the virtual rig, for at most 2 s."""
    take, file = order
    stamp = stamp_of(file)
    drive = load_solution(file).drive
    settings = Settings.of(drive.provenance) or Settings()
    before, asked = original_of_drive(drive.provenance, pressure_of(take, settings))
    lead = (asked.frames - before.frames) // 2 / asked.rate
    judged = min(before.frames / before.rate, _PALM_SECONDS)
    played = min(round((lead + judged) * drive.rate), drive.frames)
    first = replace(drive, phase=drive.phase[:played], level=drive.level[:played])
    rig = VirtualRig(cells=before.sensor, height=settings.target.grid.height).hearing(settings.calibration.band)
    shown = partial(progress, "simulating the palm")
    came = palm_of_drive(asked.cut(0.0, played / drive.rate), first, rig, progress=shown)
    found = came.fidelity(judged=(lead, judged), band=settings.calibration.band)
    rows = [[name.removeprefix("palm: "), _figure(value, unit)] for name, (value, unit) in found.figures().items()]
    return {"stamp": stamp, "palm": found.palm, "seconds": judged, "rows": rows}


def budget_of_take(order: tuple[str, str], progress: Progressed) -> dict[str, Any]:
    """Compute the error budget of a drive, stage by stage on the virtual rig, for at most 1 s."""
    take, file = order
    stamp = stamp_of(file)
    drive = load_solution(file, streamed=True).drive
    settings = Settings.of(drive.provenance) or Settings()
    before, _ = original_of_drive(drive.provenance, pressure_of(take, settings))
    judged = min(before.frames / before.rate, _BUDGET_SECONDS)
    band = settings.calibration.band
    height = settings.target.grid.height
    rig = VirtualRig(array=drive.array.nominal, cells=before.sensor, height=height).hearing(band)
    plan = BudgetPlan(settings=settings, rig=rig, lead=required_lead(settings))
    made = error_budget(before.cut(0.0, judged), plan, stage=partial(partial, progress))
    rows = [
        [each.name, _figure(each.alone.distortion_ratio, "dB"), _figure(each.so_far.distortion_ratio, "dB"), each.what]
        for each in made.stages
    ]
    return {"stamp": stamp, "seconds": judged, "band": list(band), "rows": rows}


_BUDGET_SECONDS = 1.0
"""The take is solved and played again for each stage."""

_PALM_SECONDS = 2.0
"""A palm has a thousand points."""


def make_sample(order: tuple[str, str], progress: Progressed) -> str:
    """Write a sample, or record a stroke of the virtual sensor, into a folder; returns the file name."""
    folder, thing = order
    path = Path(folder) / f"{thing}.h5"
    progress("making a sample", 0, 1)
    if thing == SOLVED:
        write_sample(path.parent)
        return path.name
    record(f"virtual:{thing}", 1.6, path=path, notes={"object": thing, "surface": "flat"}, seed=1)
    return path.name


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyRequest:
    """A study plan to draw into a new folder: from a template, of takes with questions, or of the threshold of one."""

    path: str
    template: Template
    participants: int
    takes: tuple[str, ...] = ()
    """Paths of recordings, in place of a template; one with the template detection."""
    questions: tuple[tuple[str, bool], ...] = ()
    """Texts, and whether each take is rated from 1 to 7 instead of named."""
    repetitions: int = 5

    def text(self) -> str:
        """TOML of the plan."""
        names = [Path(take).stem for take in self.takes]
        if not names or self.template == "detection":
            return template_text(self.template, take="".join(names) or None)
        named: dict[str, Any] = {"kind": "choice", "options": names, "truth": "object"}
        rating = {"kind": "rating", "low": 1, "high": 7}
        asked = [
            {"name": f"{'rating' if scale else 'which'}{i}", "text": text, **(rating if scale else named)}
            for i, (text, scale) in enumerate(self.questions, start=1)
        ]
        rated, chosen = ([one["name"] for one in asked if one["kind"] == kind] for kind in ("rating", "choice"))
        block = {"name": "main", "stimuli": names, "repetitions": self.repetitions}
        read = {"choice": chosen[0]} if chosen else {}
        read |= {"rated": rated, "within": ["object"]} if rated else {}
        return tomli_w.dumps(
            {
                "name": "study",
                "title": Path(self.path).name,
                "participants": self.participants,
                "seed": 1,
                "consent": "You will feel touches on your palm. You may stop at any time.",
                "questions": asked,
                "stimuli": [{"name": n, "source": f"{n}.drive.h5", "levels": {"object": n}} for n in names],
                "blocks": [{**block, "questions": [one["name"] for one in asked]}],
                "analysis": read,
            }
        )


def draw_study(request: StudyRequest, progress: Progressed) -> str:
    """Draw the plan of a study, and solve its drives from its takes or virtual strokes; returns the folder name."""
    text, path = request.text(), Path(request.path)
    kept = "".join(letter for letter in path.name if letter.isascii() and letter.isalnum()) or "study"
    design = read_design(text, name=kept, participants=request.participants)
    found_in = Path(request.takes[0]).parent if request.takes else None

    def drives(into: Path) -> dict[str, str]:
        made = prepare_drives(design, into, found_in=found_in, seed=design.seed, stage=partial(partial, progress))
        return {one.source: one.digest for one in made}

    StudyFolder.create(path, text, design, drives=drives)
    return path.name


def methods_of_modes() -> dict[Mode, list[str]]:
    """Return the solvers that take all terms of each mode, in the order of `METHODS`."""
    return {mode: [name for name in METHODS if takes(name) >= make().solver.asked] for mode, make in MODES.items()}


def _spectra(before: PressureFrames, after: PressureFrames) -> dict[str, Any]:
    """Power spectra of the strongest cell in dB re 1 Pa2/Hz, original and re-recorded."""
    from midair.dsp import welch

    rms = np.sqrt((before.pressure**2).mean(axis=0))
    row, column = np.unravel_index(int(rms.argmax()), rms.shape)
    frames = min(before.frames, after.frames)
    found = [welch(np.asarray(each.pressure[:frames, row, column]), before.rate) for each in (before, after)]
    frequency = found[0][0]
    levels = np.array([10 * np.log10(power.ravel() + 1e-9) for _, power in found])
    # Up to the last frequency within 60 dB of the loudest: beyond it the picture would be empty.
    last = frequency[(levels > levels.max() - 60).any(axis=0)].max()
    kept = (frequency >= 10) & (frequency <= last)
    said = np.round(levels[:, kept], 2).tolist()
    return {"channel": int(row * before.sensor.columns + column), "frequency": frequency[kept].tolist(), "db": said}


def _figure(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".rstrip()


def warm_up() -> None:
    """Import the modules for solving, so that the first job does not wait for them."""
    import importlib
    from contextlib import suppress

    with suppress(ImportError):
        importlib.import_module("numba")
