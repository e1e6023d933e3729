"""Reproduce the paper's figures, as pictures and as numbers in CSV and JSON.

Fig. 3: binary patterns and the fields solved for them (5.1). Fig. 4: experiment 5.2, modulated foci, recorded,
reproduced and re-recorded. Fig. 9, for the synthetic objects: spectra of the target pressure on both surfaces (5.3).
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from midair.datasets import Object, channel_amplitudes
from midair.dsp import band_energy
from midair.errors import InputError
from midair.evaluate import leak, perceptual_metrics, printed_error, relative_error
from midair.figures import FieldRow, fields_figure, png_bytes, spectra_figure, stimuli_figure
from midair.files import csv_text, for_json, write_file
from midair.model import (
    HEIGHT,
    Acoustics,
    AmplitudeFrames,
    Medium,
    PressureFrames,
    Provenance,
    SensorGrid,
    TransducerArray,
)
from midair.physics import focus_amplitude, propagate
from midair.pipeline import solve_with
from midair.progress import report_progress
from midair.rig import Loop, OpenRig, Stage, VirtualRig, loop, no_progress, pressure_of, record
from midair.settings import MODES, Mode, Settings, paper_mode, with_paper_mode
from midair.solvers import PLAIN
from midair.targets import MAPPINGS, interpolation_matrix

Row = Mapping[str, str | int | float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperResult:
    """One figure or table in the paper's mode and in another one."""

    name: str
    """Base name of the files."""
    title: str
    rows: tuple[Row, ...]
    """Numbers; all rows have the same keys."""
    pictures: Mapping[str, bytes]
    """PNG files by name."""
    about: Mapping[str, object] = field(default_factory=dict[str, object])
    """Parameters of the computation."""

    def plain(self) -> dict[str, object]:
        """Values for JSON; infinite values become null."""
        return {
            "name": self.name,
            "title": self.title,
            "simulated": True,
            "about": dict(self.about),
            "rows": [for_json(row) for row in self.rows],
        }

    def table(self) -> str:
        """Return the rows as CSV."""
        return csv_text(self.rows)

    def files(self, folder: Path) -> list[Path]:
        """Paths of the files that `write` creates."""
        return [folder / f"{self.name}.csv", folder / f"{self.name}.json", *(folder / name for name in self.pictures)]

    def write(self, folder: Path) -> list[Path]:
        """Write pictures, CSV and JSON into a folder; each file is written atomically."""
        folder.mkdir(parents=True, exist_ok=True)
        contents = [self.table(), json.dumps(self.plain(), indent=2), *self.pictures.values()]
        for path, content in zip(self.files(folder), contents, strict=True):
            write_file(path, content)
        return self.files(folder)


PATTERNS: Mapping[str, int] = MappingProxyType(
    {
        "one corner": 0b0000_0000_0000_0001,
        "two corners": 0b1000_0000_0000_0001,
        "diagonal": 0b1000_0100_0010_0001,
        "middle": 0b0000_0110_0110_0000,
        "ring": 0b1111_1001_1001_1111,
        "chequered": 0b1010_0101_1010_0101,
    }
)
"""Bit k is 1 if channel k is active."""


def figure_3(
    *, strength: float = 0.15, paper: Settings | None = None, best: Settings | None = None, mode: Mode = "best"
) -> PaperResult:
    """Solve patterns in both modes, from a cold start and for point sources without attenuation as in the paper.

    `strength` is the target over the peak of a single focus of the whole array, which the paper does not state. Of the
    settings of the paper and of the `mode` to compare, only grid, solver and terms are used.
    """
    array, sensor = TransducerArray.autd3(), SensorGrid()
    acoustics = Acoustics(medium=Medium(attenuation=0.0), directivity="point")
    cold = (paper or paper_mode().but(method=PLAIN, iterations=(50, 50))).but(start="zero", acoustics=acoustics)
    # Patterns are not a sequence, so phases need not be continuous.
    still = (best or MODES[mode]()).but(method="fast", fit="points", acoustics=acoustics)
    modes = with_paper_mode(mode, cold, still)
    rows: list[Row] = []
    shown: list[FieldRow] = []
    for name_of_mode, settings in report_progress(modes.items(), len(modes)):
        grid = settings.target.grid
        focus = focus_amplitude(grid, array, acoustics=acoustics)
        cells = channel_amplitudes(np.array(list(PATTERNS.values())), sensor)
        amplitude = strength * focus * cells @ interpolation_matrix(sensor, grid).T
        target = AmplitudeFrames(
            amplitude=amplitude, rate=1.0, grid=grid, provenance=Provenance(source="patterns", simulated=True)
        )
        drive = solve_with(target, array, settings).drive
        field = propagate(drive, grid)
        error, printed = relative_error(field, amplitude), printed_error(field, amplitude)
        if not shown:
            shown.append(FieldRow(name="target", fields=amplitude / focus, grid=grid, notes=tuple(PATTERNS)))
        notes: list[str] = []
        for number, name in enumerate(PATTERNS):
            part = slice(number, number + 1)
            one = replace(drive, phase=drive.phase[part], level=drive.level[part])
            outside = leak(one, amplitude[part], grid)
            notes.append(f"E {100 * error[number]:.1f} %, leak {100 * outside.peak:.0f} %")
            rows.append(
                {
                    "pattern": name,
                    "mode": name_of_mode,
                    "strength": strength,
                    "error": float(error[number]),
                    "error_as_printed": float(printed[number]),
                    "leak": outside.peak,
                }
            )
        shown.append(FieldRow(name=f"{name_of_mode} mode", fields=np.abs(field) / focus, grid=grid, notes=tuple(notes)))
    return PaperResult(
        name="figure3",
        title="Binary patterns and their fields, as in the paper's Fig. 3",
        rows=tuple(rows),
        pictures={"figure3.png": png_bytes(fields_figure(shown, sensor, quantity="sound pressure over a full focus"))},
        about={"strength": strength, "height_m": HEIGHT, "array": array.name, "sources": "points, no attenuation"},
    )


STIMULI: Mapping[str, str] = MappingProxyType(
    {"i: 100 Hz": "am-i", "ii: two points": "am-ii", "iii: 25 + 250 Hz": "am-iii"}
)
"""Names of the paper's three stimuli in the virtual rig."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StimuliPlan:
    """Settings of experiment 5.2."""

    paper: Settings = field(default_factory=paper_mode)
    best: Settings | None = None
    """Settings of the other mode; its defaults if None."""
    mode: Mode = "best"
    """Mode to compare with the paper's."""
    duration: float = 0.12
    """Duration of each stimulus in s: a multiple of 40 ms, at least 80 ms, for the spectra."""
    corrections: int = 1
    """Amplitude corrections in both modes; the paper has one."""
    iterate: int = 1
    """Waveform corrections in the other mode only."""
    rig: VirtualRig = field(default_factory=VirtualRig)

    def __post_init__(self) -> None:
        periods = self.duration / 0.04
        if periods < 2 or not np.isclose(periods, round(periods)):
            raise InputError(
                f"duration: expected a multiple of 40 ms, 80 ms or more, for figure 4, got {1e3 * self.duration:g} ms"
            )


def figure_4(plan: StimuliPlan | None = None, *, stage: Stage = no_progress) -> PaperResult:
    """Record, reproduce and re-record stimuli i to iii in both modes; call `stage` with the name of each stage."""
    plan = plan or StimuliPlan()
    rows: list[Row] = []
    shown: dict[str, dict[str, PressureFrames]] = {}
    for name, thing in STIMULI.items():
        for which, settings in with_paper_mode(plan.mode, plan.paper, plan.best).items():
            mode, iterate = f"{which} mode", 0 if which == "paper" else plan.iterate
            original = recorded(plan.rig, thing, settings, plan.duration)
            loop = reproduced(
                original, plan, settings, iterate, lambda what, m=mode, n=name: stage(f"{n[:3]} {m}: {what}")
            )
            shown.setdefault(name, {"original": original})[mode] = loop.passes[-1].felt
            rows.append(_row(thing, mode, loop))
    return PaperResult(
        name="figure4",
        title="Modulated foci, original and re-recorded, as in the paper's Fig. 4",
        rows=tuple(rows),
        pictures={"figure4.png": png_bytes(stimuli_figure(shown))},
        about={"duration_s": plan.duration, "amplitude_corrections": plan.corrections, "best_iterations": plan.iterate},
    )


def recorded(rig: VirtualRig, thing: str, settings: Settings, duration: float) -> PressureFrames:
    """Recording of an object by the virtual sensor, without the first 80 ms in which the sensor settles."""
    settle = 0.08
    with rig.touched_by(thing, duration=duration + settle) as sensor:
        return pressure_of(record(sensor, duration + settle), settings, settle, duration)


def reproduced(original: PressureFrames, plan: StimuliPlan, settings: Settings, iterate: int, stage: Stage) -> Loop:
    """Run the loop for one stimulus in one mode."""
    skin = plan.rig.skin()
    with OpenRig(array=plan.rig.array_device(skin), sensor=plan.rig.sensor(skin)) as rig:
        return loop(original, settings, rig, corrections=plan.corrections, iterate=iterate, stage=stage)


def _row(thing: str, mode: str, loop: Loop) -> Row:
    last = loop.passes[-1]
    comparison, card = last.comparison, perceptual_metrics(loop.original, last.felt)
    return {
        "stimulus": thing,
        "mode": mode,
        "passes": len(loop.passes),
        "strength": last.reproduction.strength(),
        "solver_error": float(last.reproduction.solution.error.mean()),
        "correlation": comparison.correlation,
        "gain": comparison.gain,
        "waveform_error": comparison.waveform_error,
        "sdr_db": comparison.distortion_ratio,
        "shift_mm": 1e3 * comparison.place.distance,
        "frequency_original_hz": comparison.frequency[0],
        "frequency_reproduced_hz": comparison.frequency[1],
        "st_sim": card.figure("ST-SIM").overall,
        "spqi": card.figure("SPQI").overall,
        "pacinian_difference_db": card.figure("Pacinian power difference").overall,
    }


CHANNELS = (2, 6, 10, 14)
"""Channels that the paper's objects passed over, shown in its Fig. 9."""

BANDS: Mapping[str, tuple[float, float]] = {"20_300_hz": (20.0, 300.0), "300_470_hz": (300.0, 470.0)}


def figure_9(
    *, takes: int = 5, paper: Settings | None = None, best: Settings | None = None, mode: Mode = "best"
) -> PaperResult:
    """Record strokes of the three objects and show the spectra of each mode's target pressure.

    Each object strokes each surface `takes` times, with seeds 0, 1, ...; the paper has five. The first is drawn; the
    numbers are mean powers over all. Of the settings of the paper and of the `mode` to compare, only the mappings are
    used.
    """
    modes = with_paper_mode(mode, paper or paper_mode(), best)
    rows: list[Row] = []
    shown: dict[str, dict[str, PressureFrames]] = {}
    every = list(product(("plain", "groove"), get_args(Object)))
    for surface, name in report_progress(every, len(every)):
        strokes = [_stroke(name, surface, modes["paper"], seed) for seed in range(takes)]
        for which, settings in modes.items():
            push = MAPPINGS[settings.target.mapping]
            pushed = [replace(stroke, pressure=push(stroke.pressure, stroke.rate)) for stroke in strokes]
            shown.setdefault(f"{surface}, {settings.target.mapping}", {})[name] = pushed[0]
            levels = {
                f"level_{band}_db": float(10 * np.log10(np.mean([_power(each, BANDS[band]) for each in pushed])))
                for band in BANDS
            }
            rows.append(
                {"object": name, "surface": surface, "mode": which, "mapping": settings.target.mapping} | levels
            )
    return PaperResult(
        name="figure9",
        title="Spectra of the synthetic objects, as in the paper's Fig. 9",
        rows=tuple(rows),
        pictures={"figure9.png": png_bytes(spectra_figure(shown, channels=CHANNELS, objects=True))},
        about={"takes": takes, "channels": list(CHANNELS), "unit": "dB re 1 Pa^2, mean over takes and channels"},
    )


def _stroke(name: str, surface: str, settings: Settings, seed: int) -> PressureFrames:
    rig = VirtualRig(seed=seed)
    with rig.touched_by(name + ("+groove" if surface == "groove" else "")) as sensor:
        return pressure_of(record(sensor, 1.26), settings)


def _power(pushed: PressureFrames, band: tuple[float, float]) -> float:
    signals: NDArray[np.float64] = pushed.pressure.reshape(pushed.frames, -1)[:, list(CHANNELS)]
    return float(band_energy(signals, pushed.rate, band).mean())
