"""Read the takes of a calibration from files, or simulate them, and write one as a figure (PNG) or an HTML page."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from midair.array_types import Array
from midair.calibration import (
    Reference,
    ReferencedTake,
    noise_equivalent_pressure,
    noise_signal,
    split_channel,
    sweep_signal,
    typical_uncertainty,
)
from midair.dsp import resample
from midair.errors import FileError, InputError, MismatchError, UnitError, UnknownFormatError
from midair.figures import Picture, calibration_figure, png_bytes, render_page
from midair.files import open_take, save, write_file
from midair.model import BAND, RATE, Calibration, Progress, Provenance, Recording, SensorGrid
from midair.physics import SensorModel, sense


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceChoice:
    """The reference that measured the pressure."""

    sensitivity: float | None = None
    """Sensitivity in the reference recording's unit per Pa; None for a recording in Pa."""
    uncertainty: float = 0.0
    """Relative standard uncertainty (k = 1) of the sensitivity."""
    name: str = ""
    """Name of the reference; that of its file if empty."""
    channel: int | None = None
    """Channel of the sensor's recording that holds the reference; None for separate files."""


def read_takes(
    recordings: Sequence[Path],
    references: Sequence[Path],
    choice: ReferenceChoice,
    *,
    cells: Sequence[int | None] | None = None,
) -> tuple[list[ReferencedTake], list[str]]:
    """Read the takes, and return one sentence for each adjustment that made the pairs fit.

    Each recording of the sensor has a reference file, begun at the same moment, unless the references are a channel of
    the recordings. `cells` are the channels that were pressed, None for all cells; by default from the recordings'
    notes (``pressed``: ``cell 3`` or ``all cells``).

    MismatchError if the numbers of references or cells and of recordings differ, or the lengths of a pair differ;
    UnitError if a sensitivity is missing.
    """
    if (choice.channel is None) != bool(references):
        raise MismatchError(
            "reference: expected either separate files (--reference) or a channel of the recordings "
            f"(--reference-channel), got {'both' if references else 'neither'}"
        )
    for name, given in (("--reference", references or None), ("--cell", cells)):
        if given is not None and len(given) != len(recordings):
            raise MismatchError(
                f"{name}: expected one value for each of {len(recordings)} recordings, got {len(given)}"
            )
    takes: list[ReferencedTake] = []
    notes: list[str] = []
    for index, path in enumerate(recordings):
        recording = open_take(path).recording
        if choice.channel is not None:
            recording, said = split_channel(recording, choice.channel)
        else:
            said = open_take(references[index]).recording
        recording, said, changed = _match_frames(recording, said, path)
        notes += changed
        cell = _pressed_cell(recording, path) if cells is None else cells[index]
        how: Any = {"uncertainty": choice.uncertainty, "name": choice.name, "own_clock": choice.channel is None}
        reference = Reference.read(said, sensitivity=_sensitivity(said, choice), **how)
        takes.append(ReferencedTake(recording=_with_source(recording, path), reference=reference, cell=cell))
    return takes, notes


def read_silence(path: Path) -> Recording:
    """Read a recording without pressure, named after its file."""
    return _with_source(open_take(path).recording, path)


def _match_frames(recording: Recording, said: Recording, path: Path) -> tuple[Recording, Recording, list[str]]:
    """Bring both to the sensor's rate and to the shorter length."""
    notes: list[str] = []
    if said.rate != recording.rate:
        notes.append(f"{path}: the reference was resampled from {said.rate:g} to {recording.rate:g} Hz")
        said = replace(said, samples=resample(said.samples, said.rate, recording.rate), rate=recording.rate)
    frames = min(recording.frames, said.frames)
    if max(recording.frames, said.frames) > 1.01 * frames:
        raise MismatchError(
            f"{path}: expected a reference as long as the recording, {recording.duration:.3f} s, got "
            f"{said.duration:.3f} s; record both from the same moment, or cut them to the same length"
        )
    if recording.frames != said.frames:
        notes.append(f"{path}: recording and reference were cut to {frames} frames")
    return replace(recording, samples=recording.samples[:frames]), replace(said, samples=said.samples[:frames]), notes


def _sensitivity(said: Recording, choice: ReferenceChoice) -> float:
    if choice.sensitivity is not None:
        return choice.sensitivity
    if said.unit != "Pa":
        raise UnitError(
            f"reference: expected its sensitivity for a recording in {said.unit}, got none; state it as on its "
            f"certificate (--reference-sensitivity 50m{said.unit}/Pa)"
        )
    return 1.0


def _pressed_cell(recording: Recording, path: Path) -> int | None:
    """Cell that the notes of a recording name; None for all cells."""
    note = recording.provenance.notes.get("pressed", "all cells")
    if note in ("all cells", "all"):
        return None
    number = note.removeprefix("cell").strip()
    if not number.isdecimal():
        raise InputError(
            f"{path}: expected a note 'pressed' such as 'cell 3' or 'all cells', got {note!r}; give --cell"
        )
    return int(number)


def _with_source(recording: Recording, path: Path) -> Recording:
    return replace(recording, provenance=replace(recording.provenance, source=path.name))


Rows = list[tuple[str, str]]


def write_calibration_page(calibration: Calibration, path: Path) -> None:
    """Write the figure page of a calibration to NAME.png or NAME.html; UnknownFormatError for other names."""
    check_page_name(path)
    html = path.suffix.lower() == ".html"
    write_file(path, render_calibration(calibration) if html else png_bytes(calibration_figure(calibration), dpi=100))


def check_page_name(path: Path) -> None:
    """Check the name of a figure page before any work is done; UnknownFormatError for other endings."""
    if path.suffix.lower() not in (".png", ".html"):
        raise UnknownFormatError(f"{path}: expected a name that ends in .png or .html for a figure page")


def render_calibration(calibration: Calibration) -> str:
    """Render the page as HTML without external resources."""
    # The bin closest to 100 Hz.
    at = float(calibration.frequency[np.argmin(np.abs(calibration.frequency - 100.0))])
    columns, channels = _channels(calibration, at)
    picture = Picture(
        title="Response, uncertainty, coherence, noise, crosstalk, linearity and delay",
        data=png_bytes(calibration_figure(calibration), dpi=100),
    )
    return render_page(
        "rig/bench/calibration.html.j2",
        title=f"Calibration of {calibration.sensor.name}",
        simulated=calibration.provenance.simulated,
        rows=calibration_rows(calibration),
        picture=picture,
        frequency=f"{at:g} Hz",
        columns=columns,
        channels=channels,
        steps=[
            (step.stage, ", ".join(f"{name} {value}" for name, value in step.settings.items()))
            for step in calibration.provenance.steps
        ],
    )


def calibration_rows(calibration: Calibration) -> Rows:
    """Identity, method and uncertainties of a calibration, as (name, value) pairs."""
    frequency, measured = calibration.frequency, calibration.measurement
    rows = [
        ("calibration", calibration.provenance.source),
        ("identifier", f"{calibration.identifier}, version {calibration.version}, {calibration.date or 'no date'}"),
        ("sensor", f"{calibration.sensor.name}, {calibration.sensor.rows} x {calibration.sensor.columns}"),
        ("frequencies", f"{len(frequency)} from {frequency[0]:g} to {frequency[-1]:g} Hz"),
        ("unit", f"{calibration.unit}/Pa"),
        ("uncertainty", describe_uncertainty(calibration)),
    ]
    if measured is not None:
        rows += [("method", measured.method), ("reference", measured.reference)]
    low, high = _band(calibration)
    if measured is not None and low < high:
        hidden = 1e3 * noise_equivalent_pressure(calibration, (low, high))
        unsure = 200 * float(np.median(measured.noise_uncertainty))
        level = f"{np.median(hidden):.3g} mPa rms in {low:g} to {high:g} Hz (median; worst {hidden.max():.3g})"
        rows.append(("noise-equivalent pressure", f"{level}, ± {unsure:.2g} % and that of the response"))
    if calibration.crosstalk is not None:
        away = ~np.eye(calibration.sensor.count, dtype=bool)
        largest = np.abs(calibration.crosstalk.matrix[away]).max(initial=0)
        unsure = 2 * np.median(calibration.crosstalk.uncertainty[away]) if away.any() else 0
        rows.append(("crosstalk", f"at most {largest:.3g}, each ± {unsure:.1g} (median)"))
    if calibration.linearity is not None:
        line = calibration.linearity
        worst = np.unravel_index(int(np.argmax(np.abs(line.curvature))), line.curvature.shape)
        bend = f"{100 * line.curvature[worst]:.2g} ± {200 * line.curvature_uncertainty[worst]:.2g} %"
        rows.append(("linearity", f"{line.levels} levels, largest change of the slope {bend}"))
    return rows


def describe_uncertainty(calibration: Calibration) -> str:
    """Uncertainty of a calibration, in one line."""
    measured, frequency = calibration.measurement, calibration.frequency
    if measured is None:
        return "unknown: stated, not measured"
    low, high = band = _band(calibration)
    band = band if low < high else (float(frequency[0]), float(frequency[-1]))
    typical = typical_uncertainty(calibration, band) or 0.0
    shared = 200 * measured.reference_uncertainty
    where = f"{band[0]:g} to {band[1]:g} Hz" if band[0] < band[1] else f"{band[0]:g} Hz"
    return f"± {100 * typical:.2g} % of the response (k = 2, median over {where}), {shared:.2g} % of it shared"


def _channels(calibration: Calibration, at: float) -> tuple[list[str], list[list[str]]]:
    """Heads, and a row for each channel: its values at a frequency in Hz with their expanded uncertainties."""
    measured, line = calibration.measurement, calibration.linearity
    factor, unit = (1e3, "mV") if calibration.unit == "V" else (1.0, calibration.unit)
    size = factor * np.abs(calibration.response_at(np.array([at]))[0])
    relative, (low, high) = calibration.uncertainty_at(np.array([at])), _band(calibration)
    delay = hidden = (None, None)
    if measured is not None and measured.delay.any():
        delay = 1e6 * measured.delay, 1e6 * measured.delay_uncertainty
    if measured is not None and low < high:
        noise = 1e3 * noise_equivalent_pressure(calibration, (low, high))
        unsure = np.median(measured.magnitude_uncertainty, axis=0)
        hidden = noise, noise * np.hypot(measured.noise_uncertainty, unsure)
    columns: dict[str, tuple[Array | None, Array | None]] = {
        f"sensitivity ({unit}/Pa)": (size, None if relative is None else size * relative[0]),
        "delay (µs)": delay,
        "noise-equivalent (mPa rms)": hidden,
    }
    for name, part, scale in (("gain", "gain", 1), ("intercept (Pa)", "intercept", 1), ("bend (%)", "curvature", 100)):
        parts = () if line is None else (scale * getattr(line, each) for each in (part, f"{part}_uncertainty"))
        columns[name] = (*parts,) or (None, None)
    texts = [
        ["-"] * calibration.sensor.count
        if values is None
        else [
            _with_uncertainty(value, None if sure is None else 2 * sure.flat[channel])
            for channel, value in enumerate(values.flat)
        ]
        for values, sure in columns.values()
    ]
    return ["channel", *columns], [[str(channel), *row] for channel, row in enumerate(zip(*texts, strict=True))]


def _band(calibration: Calibration) -> tuple[float, float]:
    """The part of the usual band that the calibration covers; its ends are in wrong order if there is none."""
    return max(BAND[0], float(calibration.frequency[0])), min(BAND[1], float(calibration.frequency[-1]))


def _with_uncertainty(value: float, unsure: float | None) -> str:
    if not np.isfinite(value):
        return "-"
    if unsure is None or not np.isfinite(unsure):
        return f"{value:.4g}"
    if unsure <= 0:
        return f"{value:.5g} ± 0"
    # Two significant digits of the uncertainty, and the same decimals of the value.
    digits = max(0, 1 - int(np.floor(np.log10(unsure))))
    return f"{value:.{digits}f} ± {unsure:.{digits}f}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationBench:
    """A bench that applies a known pressure to a virtual sensor."""

    model: SensorModel = field(default_factory=SensorModel)
    """The sensor; hidden from the analysis."""
    rate: float = RATE
    """Rate of sensor and reference in Hz."""
    reference_sensitivity: float = 50e-3
    """Sensitivity in V/Pa that the reference's certificate states."""
    reference_error: float = 0.0
    """Relative error of the certificate."""
    reference_uncertainty: float = 0.0
    """Relative standard uncertainty (k = 1) that the certificate states."""
    reference_noise: float = 2e-5
    """One-sided noise density in Pa/sqrt(Hz)."""
    seating: float = 0.0
    """Relative standard deviation of the pressure from take to take that the reference does not measure."""
    seed: int = 0

    def take(self, pressure: Array, *, cell: int | None = None, number: int = 0) -> ReferencedTake:
        """Record a take of `pressure`, shape (frame,), in Pa, on all cells or on one; `number` seeds its noise."""
        recording, said = self.recordings(pressure, cell=cell, number=number)
        how: Any = {"uncertainty": self.reference_uncertainty, "name": said.sensor.name, "own_clock": False}
        reference = Reference.read(said, sensitivity=self.reference_sensitivity, **how)
        return ReferencedTake(recording=recording, reference=reference, cell=cell)

    def recordings(self, pressure: Array, *, cell: int | None = None, number: int = 0) -> tuple[Recording, Recording]:
        """Recordings of the sensor and of the reference while `pressure` acts, both in V."""
        rng = np.random.default_rng((self.seed, number, 0 if cell is None else cell + 1))
        grid = self.model.grid
        acting = np.zeros((len(pressure), grid.count))
        acting[:, slice(None) if cell is None else cell] = pressure[:, None] if cell is None else pressure
        acting *= 1 + self.seating * rng.standard_normal()
        volts = sense(self.model, acting.reshape(-1, *grid.shape), self.rate, rng=rng)
        heard = pressure + self.reference_noise * np.sqrt(self.rate / 2) * rng.standard_normal(len(pressure))
        said = heard * self.reference_sensitivity * (1 + self.reference_error)
        where = "all cells" if cell is None else f"cell {cell}"
        life = Provenance(source=f"virtual bench: {where}, take {number}", simulated=True, notes={"pressed": where})
        alone = SensorGrid(rows=1, columns=1, name="virtual reference")
        return (
            Recording(samples=volts, rate=self.rate, sensor=grid, provenance=life),
            Recording(samples=said.reshape(-1, 1, 1), rate=self.rate, sensor=alone, provenance=life),
        )

    def quiet(self, duration: float) -> Recording:
        """A recording without pressure."""
        # No take has this number, so the noise differs from that of every take.
        return self.recordings(np.zeros(round(duration * self.rate)), number=10**6)[0]


def practice_bench(seed: int = 0) -> CalibrationBench:
    """A bench whose sensor has channel spread, delays and crosstalk, and a reference accurate to 1 %."""
    rng = np.random.default_rng((seed, 7))
    grid = SensorGrid(name=f"practice sensor {seed}")
    away = np.array([[abs(i // 4 - k // 4) + abs(i % 4 - k % 4) for k in range(16)] for i in range(16)])
    crosstalk = np.eye(16) + 0.03 * (away == 1) * (1 + 0.2 * rng.standard_normal((16, 16))) + 0.004 * (away == 2)
    model = SensorModel(grid=grid, delay=rng.uniform(0, 3e-4, grid.shape), crosstalk=crosstalk, saturation=6.0)
    # The error is drawn from the uncertainty that the certificate states.
    error = 0.005 * float(rng.standard_normal())
    return CalibrationBench(
        model=model.with_spread(seed=seed), reference_uncertainty=0.005, reference_error=error, seating=0.002, seed=seed
    )


PRACTICE_RECORDINGS = 22
"""Number of recordings: all cells at five levels, each of the sixteen alone, and one without pressure."""


def write_practice_recordings(
    folder: Path,
    *,
    kind: Literal["noise", "sweep"] = "noise",
    duration: float = 15.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> str:
    """Write simulated recordings of a calibration, of `duration` s each; return the command that computes it.

    All cells at five levels, each cell alone, and one without pressure, in a folder that is created if it does not
    exist. FileError if one of the files exists already.
    """
    bench = practice_bench(seed)
    folder.mkdir(parents=True, exist_ok=True)
    plan: list[tuple[str, int | None, float]] = [(f"all-{level}Pa", None, float(level)) for level in (1, 2, 5, 10, 15)]
    plan += [(f"cell-{cell:02}", cell, 10.0) for cell in range(bench.model.grid.count)]
    names = [name for name, _, _ in plan]
    for path in [folder / f"{name}{end}.h5" for name in names for end in ("", "-reference")]:
        if path.exists():
            raise FileError(f"{path}: already exists; give another folder")
    rng = np.random.default_rng((seed, 11))
    for number, (name, cell, level) in enumerate(plan):
        signal = sweep_signal(1.0, duration - 1) if kind == "sweep" else noise_signal(1.0, duration, rng=rng)
        recording, reference = bench.recordings(signal * level, cell=cell, number=number)
        save(recording, folder / f"{name}.h5", force=True)
        save(reference, folder / f"{name}-reference.h5")
        if progress:
            progress(number + 1, PRACTICE_RECORDINGS)
    save(bench.quiet(duration), folder / "quiet.h5")
    if progress:
        progress(PRACTICE_RECORDINGS, PRACTICE_RECORDINGS)
    return (
        f"midair calibrate measure {folder}/all-*Pa.h5 {folder}/cell-??.h5 "
        f"--reference {folder}/all-*-reference.h5 {folder}/cell-*-reference.h5 --reference-sensitivity 50mV/Pa "
        f"--reference-uncertainty 0.01 --quiet {folder}/quiet.h5 --figure {folder}/calibration.html"
    )
