"""Write a calibration as a figure (PNG), or as an HTML page with the figure and the values of each channel."""

from pathlib import Path

import numpy as np

from midair.calibration import noise_equivalent_pressure, typical_uncertainty
from midair.errors import BandError, UnknownFormatError
from midair.figures import Picture, calibration_figure, png_bytes, render_page
from midair.files import atomic_file
from midair.model import BAND, Calibration

Rows = list[tuple[str, str]]


def write_calibration_page(calibration: Calibration, path: Path) -> None:
    """Write the figure page of a calibration to NAME.png or NAME.html; UnknownFormatError for other names."""
    check_page_name(path)
    html = path.suffix.lower() == ".html"
    page = render_calibration(calibration).encode() if html else png_bytes(calibration_figure(calibration), dpi=100)
    with atomic_file(path) as partial:
        partial.write_bytes(page)


def check_page_name(path: Path) -> None:
    """Check the name of a figure page before any work is done; UnknownFormatError for other endings."""
    if path.suffix.lower() not in (".png", ".html"):
        raise UnknownFormatError(f"{path}: expected a name that ends in .png or .html for a figure page")


def render_calibration(calibration: Calibration) -> str:
    """Render the page as HTML without external resources."""
    # The bin closest to 100 Hz.
    at = float(calibration.frequency[np.argmin(np.abs(calibration.frequency - 100.0))])
    sensitivity = "sensitivity (mV/Pa)" if calibration.unit == "V" else f"sensitivity ({calibration.unit}/Pa)"
    others = ("delay (µs)", "noise-equivalent (mPa rms)", "gain", "intercept (Pa)", "bend (%)")
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
        columns=["channel", sensitivity, *others],
        channels=[_channel(calibration, channel, at) for channel in range(calibration.sensor.count)],
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
    low, high = max(BAND[0], float(frequency[0])), min(BAND[1], float(frequency[-1]))
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
    low, high = max(BAND[0], float(frequency[0])), min(BAND[1], float(frequency[-1]))
    band = (low, high) if low < high else (float(frequency[0]), float(frequency[-1]))
    typical = typical_uncertainty(calibration, band) or 0.0
    shared = 200 * measured.reference_uncertainty
    where = f"{band[0]:g} to {band[1]:g} Hz" if band[0] < band[1] else f"{band[0]:g} Hz"
    return f"± {100 * typical:.2g} % of the response (k = 2, median over {where}), {shared:.2g} % of it shared"


def _channel(calibration: Calibration, channel: int, at: float) -> list[str]:
    """One row of the table."""
    row, column = divmod(channel, calibration.sensor.columns)
    factor = 1e3 if calibration.unit == "V" else 1.0
    size = factor * abs(calibration.response_at(np.array([at]))[0, row, column])
    measured, line = calibration.measurement, calibration.linearity
    relative = calibration.uncertainty_at(np.array([at]))
    cells = [str(channel), _with_uncertainty(size, None if relative is None else 2 * size * relative[0, row, column])]
    if measured is None or not measured.delay.any():
        cells.append("-")
    else:
        cells.append(
            _with_uncertainty(1e6 * measured.delay[row, column], 2e6 * measured.delay_uncertainty[row, column])
        )
    cells.append(_noise_pressure(calibration, row, column))
    if line is None:
        return [*cells, "-", "-", "-"]
    for value, unsure, scale in (
        (line.gain, line.gain_uncertainty, 1.0),
        (line.intercept, line.intercept_uncertainty, 1.0),
        (line.curvature, line.curvature_uncertainty, 100.0),
    ):
        cells.append(_with_uncertainty(scale * value[row, column], 2 * scale * unsure[row, column]))
    return cells


def _noise_pressure(calibration: Calibration, row: int, column: int) -> str:
    """Noise-equivalent pressure of a channel with its uncertainty."""
    measured, frequency = calibration.measurement, calibration.frequency
    band = (max(BAND[0], float(frequency[0])), min(BAND[1], float(frequency[-1])))
    try:
        hidden = 1e3 * noise_equivalent_pressure(calibration, band)[row, column]
    except BandError:
        return "-"
    if measured is None or not np.isfinite(hidden):
        return "-"
    sure = np.hypot(measured.noise_uncertainty[row, column], np.median(measured.magnitude_uncertainty[:, row, column]))
    return _with_uncertainty(hidden, 2 * hidden * sure)


def _with_uncertainty(value: float, unsure: float | None) -> str:
    """Format a value with the digits that its uncertainty supports."""
    if unsure is None or not np.isfinite(unsure):
        return f"{value:.4g}"
    if unsure <= 0:
        return f"{value:.5g} ± 0"
    # Two significant digits of the uncertainty, and the same decimals of the value.
    digits = max(0, 1 - int(np.floor(np.log10(unsure))))
    return f"{value:.{digits}f} ± {unsure:.{digits}f}"
