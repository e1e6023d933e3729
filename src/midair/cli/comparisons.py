"""Inputs and output of commands that compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.table import Table

from midair import rig
from midair.cli.console import out, print_note
from midair.evaluate import OVERALL, RATIOS, Comparison, LaboratoryLoss, PalmFidelity, PerceptualMetrics, ratio_text
from midair.model import PressureFrames, Provenance, TransducerArray
from midair.settings import Settings


def unreproduced_rows(provenance: Provenance) -> list[tuple[str, str]]:
    """Row of the part of a recording that its drive does not reproduce; none where it is small."""
    text = provenance.last("not reproduced").get("text")
    return [("not reproduced", str(text))] if text else []


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


def print_ratios(ratios: Mapping[str, tuple[float, float, float]]) -> None:
    """Print each signal-to-distortion ratio, its limits where the sensor's noise limits it, and its meaning."""
    for name, limits in ratios.items():
        out().print(f"  {name}: {ratio_text(limits)} dB", style="bold")
        out().print(f"    {RATIOS[name]}", style="dim")


def print_metrics(card: PerceptualMetrics) -> None:
    """Print each metric over all cells, original → reproduction, and its meaning."""
    out().print("\nperceptual metrics over all cells")
    for name, value, unit, meaning in card.rows():
        out().print(f"  {name}: {value} {unit}".rstrip(), style="bold")
        if meaning:
            out().print(f"    {meaning}")


def print_palm(palm: PalmFidelity) -> None:
    """Print the fidelity on a whole palm for each skin model."""
    out().print(f"\nfidelity on a whole palm, {palm.palm}", style="bold")
    out().print(f"  {100 * palm.outside:.3g} % of the power in the band lies outside the square of the sensor")
    out().print(f"  pressure {palm.pressure:.1f} dB over the palm, {palm.square:.1f} dB within the square")
    moved = ", ".join(f"{ratio:.1f} dB ({name})" for name, ratio in palm.displacement.items())
    out().print(f"  displacement {moved}")
    out().print("    signal-to-distortion ratio in models of flat skin, not measured on people", style="dim")


def print_laboratory(found: LaboratoryLoss) -> None:
    """Print the part "palm and laboratory": what each uncertainty leaves, and all together."""
    units = "measured transducers" if found.measured else "transducers that were not measured"
    title = f"palm and laboratory, {units}: {found.nominal:.1f} dB without uncertainties, seed {found.seed}"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("uncertainty")
    for head in ("stated", "median", "5 %", "95 %"):
        table.add_column(head, justify="right")
    table.add_row("", "k = 1", "dB", "dB", "dB", style="dim")
    for name, stated, *ratios in found.rows():
        table.add_row(name, stated, *(f"{ratio:.1f}" for ratio in ratios))
    out().print()
    out().print(table)
    out().print(found.advice)
    out().print(f"{OVERALL} on the cells of the moved palm, random draws; {RATIOS[OVERALL]}", style="dim")


def print_side_by_side(outcomes: Sequence[rig.Outcome]) -> None:
    """Print the figures of several modes side by side."""
    table = Table(title="side by side" if len(outcomes) > 1 else None, title_justify="left", box=None, pad_edge=False)
    table.add_column("", overflow="fold")
    for each in outcomes:
        table.add_column(each.name, overflow="fold")
    table.add_column("unit")
    for name, unit, *values in rig.comparison_rows(outcomes):
        table.add_row(name, *values, unit)
    out().print(table)


def plain(comparison: Comparison) -> dict[str, object]:
    """A comparison as JSON values."""
    figures = {name: {"value": value, "unit": unit} for name, (value, unit) in comparison.figures().items()}
    for name, (_, low, high) in comparison.ratios.items():
        if low != high:
            figures[name] |= {"low": low, "high": high}
    return {"simulated": comparison.simulated, "figures": figures}
