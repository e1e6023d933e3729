"""Commands of a calibration of a sensor: `calibrate` (apply it), `show`, `measure`, `beam`, `bench`."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from midair import rig
from midair.calibration import BeamPlan, BeamSetting, MeasureSettings, calibrate, measure_calibration
from midair.cli.console import out, progress_bars
from midair.cli.exposure_options import RoomOptions
from midair.cli.import_options import calibration_from_options, stated_sensitivity
from midair.cli.options import (
    BandOptions,
    Device,
    Force,
    Frequency,
    Json,
    Length,
    Peak,
    Seed,
    Sensitivity,
    Time,
    quantity,
)
from midair.cli.output import calibration_row, may_write, next_row, print_table
from midair.errors import InputError, MismatchError, MissingFileError
from midair.files import CALIBRATION_SUFFIX, load_calibration, open_take, save, save_calibration
from midair.model import HEIGHT, Acoustics, Calibration, SensorGrid
from midair.table import Line, Row


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class OutputOptions:
    """Where to write a calibration."""

    output: Path | None = None
    """File to write, NAME.calibration.h5. [default: the sensor's name and the date]"""
    date: str | None = None
    """Date of the measurement, ISO 8601. [default: today]"""
    supersedes: Path | None = None
    """Earlier calibration of the same sensor: the new one gets the next version and is compared with it."""
    figure: Path | None = None
    """Write figures of the calibration to NAME.png or NAME.html."""
    force: Force = False
    json: Json = False

    @property
    def day(self) -> str:
        """Date of the measurement."""
        return self.date or datetime.now(UTC).date().isoformat()

    def path(self, sensor: SensorGrid) -> Path:
        """Output file, after checking that it may be written."""
        name = re.sub(r"[^\w.-]+", "-", sensor.name).strip("-") or "sensor"
        target = self.output or Path(f"{name}-{self.day}{CALIBRATION_SUFFIX}")
        may_write(target, self.force)
        prepare_page(self.figure, self.force)
        return target

    def version(self, sensor: SensorGrid) -> int:
        """Version of the superseded calibration plus one, or 1."""
        if self.supersedes is None:
            return 1
        old = require_calibration(self.supersedes)
        if old.sensor != sensor:
            raise MismatchError(
                f"{self.supersedes}: expected a calibration of {sensor.name!r}, got one of {old.sensor.name!r}"
            )
        return old.version + 1

    def write(self, calibration: Calibration, notes: list[str]) -> None:
        """Write calibration and page, and print the difference from the superseded one."""
        target = self.path(calibration.sensor)
        if self.supersedes is not None:
            notes = [*notes, drift(require_calibration(self.supersedes), calibration)]
        save_calibration(calibration, target)
        print_calibration(calibration, written=target, page=self.figure, json=self.json, notes=notes)


def drift(old: Calibration, new: Calibration) -> str:
    """Difference between two calibrations of a sensor, and whether their uncertainties explain it."""
    low, high = max(old.frequency[0], new.frequency[0]), min(old.frequency[-1], new.frequency[-1])
    if low > high:
        return "no comparison: it has no frequency in common with the superseded calibration"
    frequency = np.linspace(low, high, 64)
    was, now = np.abs(old.response_at(frequency)), np.abs(new.response_at(frequency))
    heard = (was > 0) & (now > 0)
    change = np.divide(now, was, out=np.ones_like(was), where=heard) - 1
    worst = np.unravel_index(int(np.argmax(np.abs(change))), change.shape)
    channel = int(worst[1]) * old.sensor.columns + int(worst[2])
    told = f"since {old.identifier} (version {old.version}, {old.date}) the response has changed by "
    told += f"{100 * np.median(change):.2g} % (median), at most {100 * change[worst]:.2g} % (channel {channel}"
    told += f", {frequency[worst[0]]:.0f} Hz)"
    before, after = old.uncertainty_at(frequency), new.uncertainty_at(frequency)
    if before is None or after is None:
        return told
    # E_n of ISO 13528, 9.7: difference over the root of the sum of squares of both expanded uncertainties.
    score = np.abs(change) / np.maximum(2 * np.hypot(before, after), 1e-12)
    return f"{told}; E_n {np.median(score[heard]):.2g} (median), {100 * (score[heard] > 1).mean():.1f} % above 1"


def require_calibration(path: Path) -> Calibration:
    """The calibration in a file; MissingFileError if there is none."""
    found = load_calibration(path)
    if found is None:
        raise MissingFileError(f"{path}: expected a calibration in it, found none; run midair calibrate measure")
    return found


def prepare_page(page: Path | None, force: bool) -> None:
    """Refuse a page that cannot be written, before the work begins."""
    if page is not None:
        rig.check_page_name(page)
        may_write(page, force)


def print_calibration(
    calibration: Calibration, *, written: Path | None = None, page: Path | None, json: bool, notes: Sequence[str] = ()
) -> None:
    """Print a calibration, and write its page if requested."""
    if page is not None:
        rig.write_calibration_page(calibration, page)
    files = {"written": written, "page": page}
    table: list[Line] = [Row(name, text) for name, text in rig.calibration_rows(calibration)]
    table += [Row(name, str(file)) for name, file in files.items() if file is not None]
    table += [*(("note", note) for note in notes), {"notes": notes}]
    print_table(table, simulated=calibration.provenance.simulated, json=json)


def apply_command(
    source: Path,
    /,
    *,
    options: BandOptions | None = None,
    sensitivity: Sensitivity = None,
    peak: Peak = None,
    calibration: Path | None = None,
    crosstalk: Literal["keep", "undo"] = "keep",
    damping: float = 0.0,
    force: Force = False,
) -> None:
    """Convert a recording to pressure, and store the pressure and the calibration in its file.

    Another calibration than that of the file replaces it with --force only.

    Parameters
    ----------
    source
        Recording, NAME.h5; the result is stored in this file.
    calibration
        NAME.calibration.h5, or a recording with the calibration. [default: that of the recording]
    crosstalk
        Keep the crosstalk between cells, or undo it.
    damping
        With --crosstalk undo: 0 inverts the crosstalk matrix; larger values undo less.

    Examples
    --------
    $ midair calibrate take.h5 --peak 30Pa
    $ midair calibrate take.h5 --sensitivity 20mV/Pa --force
    """
    chosen = (options or BandOptions()).settings().calibration
    may_write(source, force=True)
    take = (rig.calibrated_take if {sensitivity, peak, calibration} == {None} else open_take)(source)
    recording = take.recording
    old, known = take.calibration, calibration_from_options(recording, sensitivity, peak)
    known = known or (require_calibration(calibration) if calibration else old)
    if old is not None and known is not None and known.identifier != old.identifier and not force:
        raise InputError(f"{source}: has a calibration, that of {old.provenance.source}; --force replaces it")
    pressure = calibrate(recording, known, band=chosen.band, crosstalk=crosstalk, damping=damping)
    save(recording, source, calibration=known, pressure=pressure)
    largest, rms = np.abs(pressure.pressure).max(), np.sqrt(np.square(pressure.pressure).mean(axis=0).max())
    table: list[Line] = [
        ("file", str(source)),
        ("band", f"{chosen.band[0]:g} to {chosen.band[1]:g} Hz"),
        calibration_row(known),
        ("uncertainty", "" if known is None else rig.describe_uncertainty(known)),
        ("crosstalk", "" if crosstalk == "keep" else f"undone, damping {damping:g}"),
        next_row("solve", source),
    ]
    answer = f"pressure up to {largest:.3g} Pa, {rms:.3g} Pa rms in the strongest cell"
    print_table(table, answer=answer, simulated=pressure.provenance.simulated, json=False)


def show_command(source: Path, page: Path | None = None, /, *, force: Force = False, json: Json = False) -> None:
    """Print a calibration with its uncertainty, and draw it.

    Parameters
    ----------
    source
        NAME.calibration.h5, or a recording with a calibration.
    page
        Write the figures to this file, NAME.png or NAME.html.

    Examples
    --------
    $ midair calibrate show take.h5 calibration.html
    """
    prepare_page(page, force)
    print_calibration(require_calibration(source), page=page, json=json)


Files = Annotated[tuple[Path, ...], Parameter(consume_multiple=True)]
Cells = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]
"""Channel numbers, or "all"."""


def measure_command(
    *recordings: Path,
    reference: Files = (),
    reference_channel: int | None = None,
    reference_sensitivity: str | None = None,
    reference_diameter: Annotated[float | None, quantity("m")] = None,
    reference_uncertainty: float = 0.0,
    reference_name: str = "",
    cell: Cells = (),
    quiet: Path | None = None,
    resolution: Frequency = 1.0,
    coherence: float = 0.9,
    options: OutputOptions | None = None,
) -> None:
    """Measure a calibration against a reference sensor, with noise or sweeps on all cells or on each cell.

    Five levels give the linearity, recordings of single cells the crosstalk, repeated recordings the repeatability.

    Parameters
    ----------
    recordings
        Recordings of the sensor under noise or a sweep of the whole band, 12 s or more each.
    reference
        Recordings of the reference sensor, one per recording, started at the same time.
    reference_channel
        Channel of the recordings that carries the reference, instead of --reference.
    reference_sensitivity
        From the certificate of the reference, such as 50mV/Pa; for a force cell 10mV/N and --reference-diameter.
    reference_diameter
        Diameter of the round tip of a force cell, such as 8mm.
    reference_uncertainty
        Relative uncertainty (k = 2) of the reference from its certificate: 0.02 for 2 %.
    reference_name
        Make, model and serial number of the reference.
    cell
        Cell under load in each recording: channel numbers from 0, or all. [default: from the notes of the recordings]
    quiet
        Recording without load, to measure the noise.
    resolution
        Frequency resolution.
    coherence
        Lowest coherence of a frequency bin to use it.

    Examples
    --------
    $ midair calibrate measure bench/all-1Pa.h5 --reference bench/all-1Pa-reference.h5 --reference-sensitivity 50mV/Pa
    """
    options = options or OutputOptions()
    if not recordings:
        raise InputError("recordings: expected one or more, got none; see midair calibrate measure --help")
    choice = rig.ReferenceChoice(
        sensitivity=_sensitivity(reference_sensitivity, reference_diameter),
        uncertainty=reference_uncertainty / 2,
        name=reference_name,
        channel=reference_channel,
    )
    takes, notes = rig.read_takes(recordings, reference, choice, cells=_cells(cell) if cell else None)
    sensor = takes[0].recording.sensor
    options.path(sensor)
    calibration = measure_calibration(
        takes,
        quiet=None if quiet is None else rig.read_silence(quiet),
        settings=MeasureSettings(resolution=resolution, coherence=coherence),
        date=options.day,
        version=options.version(sensor),
    )
    options.write(calibration, notes)


def beam_command(
    sensor: str = "virtual",
    /,
    *,
    device: Device = "virtual",
    levels: int = 6,
    top: Annotated[float, quantity("Pa")] = 100.0,
    height: Length = HEIGHT,
    aperture: Length = 8e-3,
    spread: Length = 1e-3,
    pressure_uncertainty: float = 0.3,
    room: RoomOptions | None = None,
    seed: Seed = 0,
    options: OutputOptions | None = None,
) -> None:
    """Measure a calibration with a focused beam on every cell, without a reference (the paper's section 5.2).

    Differences between channels are accurate; the overall level relies on the model of the array.
    To correct the level, measure one cell with midair calibrate measure.

    Parameters
    ----------
    sensor
        virtual, or a sensor as in midair record, lying face down over the centre of the array.
    levels
        Number of pressure levels per cell, 5 or more.
    top
        Highest pressure in the centre of the focus.
    height
        Height of the sensor above the array.
    aperture
        Side of the square over which a cell averages the pressure.
    spread
        Standard deviation of the point spread in the gel.
    pressure_uncertainty
        Relative uncertainty (k = 2) of the array's radiation pressure.

    Examples
    --------
    $ midair calibrate beam
    """
    options, room = options or OutputOptions(), room or RoomOptions()
    virtual = rig.VirtualRig(seed=seed, height=height)
    source, array = rig.bench_devices(sensor, device, virtual)
    setting = BeamSetting(
        height=height, aperture=aperture, spread=spread, pressure_uncertainty=pressure_uncertainty / 2
    )
    medium = room.assumed()
    with progress_bars() as stage, array, source:
        options.path(source.grid)
        calibration = rig.calibrate_by_beam(
            array,
            source,
            BeamPlan(levels=levels, top=top),
            setting=setting,
            acoustics=Acoustics(medium=medium),
            exposure=room.limits(),
            date=options.day,
            version=options.version(source.grid),
            progress=stage("beam on each cell"),
        )
    options.write(calibration, [])


def bench_command(
    folder: Path, /, *, kind: Literal["noise", "sweep"] = "noise", duration: Time = 15.0, seed: Seed = 0
) -> None:
    """Simulate recordings of a calibration bench, to practise midair calibrate measure; all are marked SIMULATED.

    Parameters
    ----------
    folder
        Output folder: recordings of sensor and reference on all cells at five levels, on each cell, and of noise.
    kind
        Signal on the sensor.
    duration
        Length of each recording.

    Examples
    --------
    $ midair calibrate bench bench --kind sweep
    """
    with progress_bars() as stage:
        progress = stage("simulate")
        command = rig.write_practice_recordings(folder, kind=kind, duration=duration, seed=seed, progress=progress)
    out().print("now measure:", command, sep="\n")


def _cells(words: tuple[str, ...]) -> list[int | None]:
    for word in words:
        if word != "all" and not word.isdecimal():
            raise InputError(f"--cell: expected channel numbers from 0, or all, got {word!r}")
    return [None if word == "all" else int(word) for word in words]


def _sensitivity(text: str | None, diameter: float | None) -> float | None:
    """Sensitivity in V/Pa; that of a force cell is V/N times the area of its tip."""
    if text is None:
        return None
    if diameter is None:
        return stated_sensitivity(text, "V/Pa", "--reference-sensitivity")
    return stated_sensitivity(text, "V/N", "--reference-sensitivity") * np.pi * diameter**2 / 4
