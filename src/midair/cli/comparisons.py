"""Inputs and output of commands that compare."""

from __future__ import annotations

from pathlib import Path

from midair import rig
from midair.cli.console import print_grid, print_note
from midair.evaluate import RATIOS, Comparison, LaboratoryLoss, PalmFidelity, PerceptualMetrics, Verdict, ratio_text
from midair.model import PressureFrames, TransducerArray
from midair.settings import Settings
from midair.table import Details, Line


def stated_array_calibration(path: Path | None, device: str, settings: Settings) -> rig.KeptCalibration | None:
    """The calibration of a file, or by default that stored for a device; prints its age and what differs from it."""
    kept = rig.array_calibration_for(device, path)
    if kept is not None:
        print_note(f"array calibration: {kept.described(settings)}")
    return kept


def with_array_calibration(
    path: Path | None, array: TransducerArray, settings: Settings, pressure: PressureFrames, *, device: str = "virtual"
) -> tuple[TransducerArray, Settings, PressureFrames]:
    """Array, settings and pressure of a solve for measured transducers, if there are any."""
    kept = stated_array_calibration(path, device, settings)
    return (array, settings, pressure) if kept is None else kept.applied(array, settings, pressure)


def verdict_lines(verdict: Verdict) -> tuple[str, list[Line]]:
    """The first line of a verdict, as the answer of a command, and the others."""
    first, *others = verdict.rows()
    return " ".join(first), list[Line](others)


def comparison_lines(comparison: Comparison, card: PerceptualMetrics | None) -> list[tuple[str, str]]:
    """Every figure of a comparison, and its perceptual metrics over all cells, original → reproduction."""
    metrics = [] if card is None else card.rows()
    return [
        *((name, f"{value:.4g} {unit}") for name, (value, unit) in comparison.figures().items() if name not in RATIOS),
        *((name, f"{ratio_text(limits)} dB; {RATIOS[name]}") for name, limits in comparison.ratios.items()),
        *((name, "; ".join(filter(None, [f"{value} {unit}".rstrip(), about]))) for name, value, unit, about in metrics),
    ]


def palm_lines(palm: PalmFidelity) -> list[Line]:
    """The fidelity on a whole palm, for each skin model."""
    moved = ", ".join(f"{ratio:.1f} dB ({name})" for name, ratio in palm.displacement.items())
    return [
        ("beside", f"{float(f'{100 * palm.outside:.2g}'):g} % of the power outside the recorded square"),
        Details(
            [
                ("palm", f"{palm.palm}; signal to distortion in models of flat skin, not measured on people"),
                ("palm, pressure", f"{palm.pressure:.1f} dB over the palm, {palm.square:.1f} dB within the square"),
                ("palm, movement", moved),
            ]
        ),
    ]


def laboratory_lines(found: LaboratoryLoss) -> list[Line]:
    """What all uncertainties of a laboratory together leave, and what to do about the largest."""
    place = [("place", found.place)] if found.place else []
    ideal = f"{found.nominal:.0f} dB with nothing out of place"
    return [("laboratory", found.text()), *place, ("ideal", ideal), ("advice", found.advice)]


def print_laboratory(found: LaboratoryLoss) -> None:
    """Print what each uncertainty of a laboratory leaves, and all together."""
    units = "measured transducers" if found.measured else "transducers that were not measured"
    rows = [(name, stated, *(f"{ratio:.1f}" for ratio in ratios)) for name, stated, *ratios in found.rows()]
    title = f"palm and laboratory, {units}, seed {found.seed}"
    print_grid(("uncertainty", "stated, k = 1", "median dB", "5 %", "95 %"), rows, title=title)


def plain(comparison: Comparison) -> dict[str, object]:
    """A comparison as JSON values."""
    figures = {name: {"value": value, "unit": unit} for name, (value, unit) in comparison.figures().items()}
    for name, (_, low, high) in comparison.ratios.items():
        if low != high:
            figures[name] |= {"low": low, "high": high}
    return {"simulated": comparison.simulated, "figures": figures}
