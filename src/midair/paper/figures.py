"""Reproduce the paper's figures, as pictures and as numbers in CSV and JSON.

Fig. 3: binary patterns and the fields solved for them (5.1). Fig. 4: experiment 5.2, modulated foci, recorded,
reproduced and re-recorded. Fig. 9, for the synthetic objects: spectra of the target pressure on both surfaces (5.3).
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import get_args

import numpy as np

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
        rows = [for_json(row) for row in self.rows]
        return {"name": self.name, "title": self.title, "simulated": True, "about": dict(self.about), "rows": rows}

    def write(self, folder: Path) -> list[Path]:
        """Write pictures, CSV and JSON into a folder, each atomically; returns their paths."""
        folder.mkdir(parents=True, exist_ok=True)
        texts = {f"{self.name}.csv": csv_text(self.rows), f"{self.name}.json": json.dumps(self.plain(), indent=2)}
        contents = {folder / name: content for name, content in (texts | dict(self.pictures)).items()}
        for path, content in contents.items():
            write_file(path, content)
        return list(contents)


PATTERNS = {
    "one corner": 0b0000_0000_0000_0001,
    "two corners": 0b1000_0000_0000_0001,
    "diagonal": 0b1000_0100_0010_0001,
    "middle": 0b0000_0110_0110_0000,
    "ring": 0b1111_1001_1001_1111,
    "chequered": 0b1010_0101_1010_0101,
}
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
    for mode_name, settings in report_progress(modes.items(), len(modes)):
        grid = settings.target.grid
        focus = focus_amplitude(grid, array, acoustics=acoustics)
        cells = channel_amplitudes(np.array(list(PATTERNS.values())), sensor)
        amplitude = strength * focus * cells @ interpolation_matrix(sensor, grid).T
        source = Provenance(source="patterns", simulated=True)
        target = AmplitudeFrames(amplitude=amplitude, rate=1.0, grid=grid, provenance=source)
        drive = solve_with(target, array, settings).drive
        field = propagate(drive, grid)
        error, printed = relative_error(field, amplitude), printed_error(field, amplitude)
        leaks = [
            leak(replace(drive, phase=drive.phase[[i]], level=drive.level[[i]]), amplitude[[i]], grid).peak
            for i in range(len(PATTERNS))
        ]
        if not shown:
            shown.append(FieldRow(name="target", fields=amplitude / focus, grid=grid, notes=tuple(PATTERNS)))
        notes = tuple(f"E {100 * e:.1f} %, leak {100 * outside:.0f} %" for e, outside in zip(error, leaks, strict=True))
        shown.append(FieldRow(name=f"{mode_name} mode", fields=np.abs(field) / focus, grid=grid, notes=notes))
        rows += [
            {"pattern": name, "mode": mode_name, "strength": strength}
            | {"error": float(error[i]), "error_as_printed": float(printed[i]), "leak": leaks[i]}
            for i, name in enumerate(PATTERNS)
        ]
    return PaperResult(
        name="figure3",
        title="Binary patterns and their fields, as in the paper's Fig. 3",
        rows=tuple(rows),
        pictures={"figure3.png": png_bytes(fields_figure(shown, sensor, quantity="sound pressure over a full focus"))},
        about={"strength": strength, "height_m": HEIGHT, "array": array.name, "sources": "points, no attenuation"},
    )


STIMULI = {"i: 100 Hz": "am-i", "ii: two points": "am-ii", "iii: 25 + 250 Hz": "am-iii"}
"""Names of the paper's three stimuli in the virtual rig."""


def figure_4(
    *,
    paper: Settings | None = None,
    best: Settings | None = None,
    mode: Mode = "best",
    duration: float = 0.12,
    corrections: int = 1,
    iterate: int = 1,
    rig: VirtualRig | None = None,
    stage: Stage = no_progress,
) -> PaperResult:
    """Record, reproduce and re-record stimuli i to iii in the paper's mode and in another one.

    Each stimulus lasts `duration` s: a multiple of 40 ms, at least 80 ms, for the spectra. Both modes correct the
    amplitude `corrections` times, once in the paper; the other mode corrects the waveform `iterate` times. `stage` is
    called with the name of each stage. Raises InputError for another duration.
    """
    if duration < 0.08 or not np.isclose(duration / 0.04, round(duration / 0.04)):
        raise InputError(
            f"duration: expected a multiple of 40 ms, 80 ms or more, for figure 4, got {1e3 * duration:g} ms"
        )
    rig, settle = rig or VirtualRig(), 0.08  # the sensor settles in the first 80 ms
    rows: list[Row] = []
    shown: dict[str, dict[str, PressureFrames]] = {}
    for name, thing in STIMULI.items():
        for which, settings in with_paper_mode(mode, paper or paper_mode(), best).items():
            called = f"{which} mode"
            with rig.touched_by(thing, duration=duration + settle) as sensor:
                original = pressure_of(record(sensor, duration + settle), settings, settle, duration)
            skin = rig.skin()
            with OpenRig(array=rig.array_device(skin), sensor=rig.sensor(skin)) as opened:
                done = loop(
                    original,
                    settings,
                    opened,
                    corrections=corrections,
                    iterate=0 if which == "paper" else iterate,
                    stage=lambda what, start=f"{name[:3]} {called}": stage(f"{start}: {what}"),
                )
            shown.setdefault(name, {"original": original})[called] = done.passes[-1].felt
            rows.append(_row(thing, called, done))
    return PaperResult(
        name="figure4",
        title="Modulated foci, original and re-recorded, as in the paper's Fig. 4",
        rows=tuple(rows),
        pictures={"figure4.png": png_bytes(stimuli_figure(shown))},
        about={"duration_s": duration, "amplitude_corrections": corrections, "best_iterations": iterate},
    )


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

BANDS = {"20_300_hz": (20.0, 300.0), "300_470_hz": (300.0, 470.0)}


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
        strokes: list[PressureFrames] = []
        for seed in range(takes):
            with VirtualRig(seed=seed).touched_by(name + "+groove" * (surface == "groove")) as sensor:
                strokes.append(pressure_of(record(sensor, 1.26), modes["paper"]))
        for which, settings in modes.items():
            mapping = settings.target.mapping
            pushed = [replace(one, pressure=MAPPINGS[mapping](one.pressure, one.rate)) for one in strokes]
            shown.setdefault(f"{surface}, {mapping}", {})[name] = pushed[0]
            row: dict[str, str | float] = {"object": name, "surface": surface, "mode": which, "mapping": mapping}
            for band, limits in BANDS.items():
                signals = [one.pressure.reshape(one.frames, -1)[:, CHANNELS] for one in pushed]
                power = [band_energy(each, pushed[0].rate, limits).mean() for each in signals]
                row[f"level_{band}_db"] = float(10 * np.log10(np.mean(power)))
            rows.append(row)
    return PaperResult(
        name="figure9",
        title="Spectra of the synthetic objects, as in the paper's Fig. 9",
        rows=tuple(rows),
        pictures={"figure9.png": png_bytes(spectra_figure(shown, channels=CHANNELS, objects=True))},
        about={"takes": takes, "channels": list(CHANNELS), "unit": "dB re 1 Pa^2, mean over takes and channels"},
    )
