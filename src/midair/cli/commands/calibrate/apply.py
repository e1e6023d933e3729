"""The commands `calibrate` (convert a recording to pressure) and `calibrate show`."""

from pathlib import Path
from typing import Literal

import numpy as np

from midair.calibration import calibrate
from midair.cli.commands.calibrate.output import prepare_page, print_calibration, require_calibration
from midair.cli.console import banner, print_rows
from midair.cli.import_options import calibration_from_options
from midair.cli.options import BandOptions, Force, Json, Peak, Sensitivity
from midair.cli.output import calibration_text, may_write
from midair.files import load_pressure, open_take, save
from midair.rig import describe_uncertainty
from midair.streaming import moments


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
) -> None:
    """Convert a recording to pressure, and store the pressure and the calibration in its file.

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
    $ midair calibrate take.h5 --sensitivity 20mV/Pa
    """
    chosen = (options or BandOptions()).settings().calibration
    may_write(source, force=True)
    take = open_take(source, streamed=True)
    recording = take.recording
    known = calibration_from_options(recording, sensitivity, peak)
    known = known or (require_calibration(calibration) if calibration else take.calibration)
    pressure = calibrate(
        recording, known, band=chosen.band, method=chosen.inverse, crosstalk=crosstalk, damping=damping
    )
    # For a midair file, read the largest pressure back from the file: computing it here would calibrate twice.
    found = None if take.stored else moments(pressure.pressure)
    save(recording, source, calibration=known, pressure=pressure)
    found = found or moments((load_pressure(source, streamed=True) or pressure).pressure)
    banner(pressure.provenance.simulated)
    print_rows(
        [
            ("recording", str(source)),
            ("calibration", calibration_text(known)),
            *(() if known is None else (("uncertainty", describe_uncertainty(known)),)),
            ("band", f"{chosen.band[0]:g} to {chosen.band[1]:g} Hz"),
            ("crosstalk", "kept" if crosstalk == "keep" else f"undone, damping {damping:g}"),
            ("largest pressure", f"{found.largest:.3g} Pa"),
            ("rms of the strongest cell", f"{np.hypot(found.spread, found.mean).max():.3g} Pa"),
        ]
    )


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
    print_calibration(require_calibration(source), [], page=page, json=json)
