"""The command `calibrate`: from what a sensor said to pressure; and the page of a calibration."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import App

from midair.calibration import calibrate
from midair.cli.commands.import_export import may_write
from midair.cli.commands.info import calibrated_by
from midair.cli.terminal.console import banner, print_json, print_rows
from midair.cli.terminal.keeping import keep
from midair.cli.terminal.nominal import nominal_calibration
from midair.cli.terminal.options import BandOptions
from midair.cli.terminal.quantity import quantity
from midair.errors import MissingFileError
from midair.files import load, load_calibration, save_calibration
from midair.model import Calibration
from midair.rig.bench.calibration_page import calibration_rows, check_page_name, uncertainty_of, write_calibration_page

app = App(
    name="calibrate",
    help="Turn a recording into pressure: midair calibrate RECORDING. What a calibration is measured with: against a "
    "reference (measure), by a tone of known level (tone), by a focused beam (beam).",
)

Pressure = Annotated[float | None, quantity("Pa")]


@app.default
def apply_command(
    source: Path,
    /,
    *,
    options: BandOptions | None = None,
    sensitivity: str | None = None,
    peak: Pressure = None,
    calibration: Path | None = None,
    crosstalk: Literal["keep", "undo"] = "keep",
    damping: float = 0.0,
) -> None:
    """Turn a recording into pressure, and keep the calibration and the pressure in its file.

    Parameters
    ----------
    source
        A recording, NAME.h5.
    options
        The band.
    sensitivity
        Output of every channel per pressure, such as 20mV/Pa or 2count/Pa.
    peak
        The largest change of any channel is to mean this pressure, such as 30Pa.
    calibration
        NAME.calibration.h5, or a recording that has the right one; the recording's own if not given.
    crosstalk
        Whether to undo what the cells feel of each other's pressure.
    damping
        Of that: 0 for the inverse of the crosstalk matrix, more for less.
    """
    options = options or BandOptions()
    recording = load(source)
    known = nominal_calibration(recording, sensitivity, peak)
    known = known or (given_calibration(calibration) if calibration else load_calibration(source))
    pressure = calibrate(
        recording, known, band=options.band, method=options.inverse, crosstalk=crosstalk, damping=damping
    )
    keep(recording, source, calibration=known, pressure=pressure)
    banner(pressure.provenance.simulated)
    largest = np.abs(pressure.pressure).max()
    print_rows(
        [
            ("recording", str(source)),
            ("calibration", calibrated_by(known)),
            *(() if known is None else (("uncertainty", uncertainty_of(known)),)),
            ("band", f"{options.band[0]:g} to {options.band[1]:g} Hz"),
            ("crosstalk", "kept" if crosstalk == "keep" else f"undone, damping {damping:g}"),
            ("largest pressure", f"{largest:.3g} Pa"),
            ("rms of the strongest cell", f"{np.sqrt((pressure.pressure**2).mean(axis=0)).max():.3g} Pa"),
        ]
    )


@app.command(name="show")
def show_command(source: Path, page: Path | None = None, /, *, force: bool = False, json: bool = False) -> None:
    """Say what a calibration is worth, and draw its page.

    Parameters
    ----------
    source
        NAME.calibration.h5, or a recording that has one.
    page
        NAME.png or NAME.html.
    force
        Write over a file that is there.
    json
        Print JSON for a program.
    """
    prepare_page(page, force)
    tell(given_calibration(source), [], page=page, json=json)


def given_calibration(path: Path) -> Calibration:
    """The calibration of a file that must have one.

    Raises
    ------
    MissingFileError
        If it is a recording without one.
    """
    found = load_calibration(path)
    if found is None:
        raise MissingFileError(f"{path}: expected a calibration in it, found none; run midair calibrate measure")
    return found


def prepare_page(page: Path | None, force: bool) -> None:
    """Refuse a page that could not be written, before the work is done."""
    if page is not None:
        check_page_name(page)
        may_write(page, force)


def finish(calibration: Calibration, output: Path, *, page: Path | None, json: bool, notes: list[str]) -> None:
    """Write a calibration that was made and its page, and say what it is."""
    save_calibration(calibration, output)
    tell(calibration, [("written", str(output))], page=page, json=json, notes=notes)


def tell(
    calibration: Calibration,
    rows: list[tuple[str, str]],
    *,
    page: Path | None,
    json: bool,
    notes: list[str] | None = None,
) -> None:
    """Print what a calibration is, and write its page if one is wanted."""
    if page is not None:
        write_calibration_page(calibration, page)
        rows = [*rows, ("page", str(page))]
    rows = [*calibration_rows(calibration), *rows]
    simulated = calibration.provenance.simulated
    if json:
        return print_json({**dict(rows), "simulated": simulated, "notes": notes or []})
    banner(simulated)
    print_rows([*rows, *(("note", note) for note in notes or [])])
    return None
