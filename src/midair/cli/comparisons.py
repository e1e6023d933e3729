"""Printed and JSON output of comparisons and perceptual metrics."""

from collections.abc import Sequence

from rich.table import Table

from midair.cli.console import out
from midair.errors import ShapeError
from midair.evaluate import Comparison, PalmFidelity, PerceptualMetrics, perceptual_metrics
from midair.model import PressureFrames
from midair.rig import Outcome, comparison_rows


def metrics_or_none(original: PressureFrames, reproduced: PressureFrames) -> PerceptualMetrics | None:
    """Perceptual metrics; None for less than 64 ms, the shortest signal they need."""
    try:
        return perceptual_metrics(original, reproduced)
    except ShapeError:
        return None


def print_metrics(card: PerceptualMetrics) -> None:
    """Print each metric over all cells, and its meaning."""
    out().print(f"\n{card.verdict()}")
    out().print("perceptual metrics over all cells")
    for each in card.figures:
        unit = f" {each.unit}" if each.unit else ""
        out().print(f"  {each.name}: {each.overall:.3g}{unit}", style="bold")
        out().print(f"    {each.meaning}")


def print_palm(palm: PalmFidelity) -> None:
    """Print the fidelity on a whole palm for each skin model."""
    out().print(f"\nfidelity on a whole palm, {palm.palm}", style="bold")
    out().print(f"  {100 * palm.outside:.3g} % of the power in the band lies outside the square of the sensor")
    out().print(f"  pressure {palm.pressure:.1f} dB over the palm, {palm.square:.1f} dB within the square")
    moved = ", ".join(f"{ratio:.1f} dB ({name})" for name, ratio in palm.displacement.items())
    out().print(f"  displacement {moved}")
    out().print("    signal-to-distortion ratio in models of flat skin, not measured on people", style="dim")


def print_side_by_side(outcomes: Sequence[Outcome]) -> None:
    """Print the figures of several modes side by side."""
    table = Table(title="side by side" if len(outcomes) > 1 else None, title_justify="left", box=None, pad_edge=False)
    table.add_column("", overflow="fold")
    for each in outcomes:
        table.add_column(each.name, overflow="fold")
    table.add_column("unit")
    for name, unit, *values in comparison_rows(outcomes):
        table.add_row(name, *values, unit)
    out().print(table)


def plain(comparison: Comparison) -> dict[str, object]:
    """A comparison as JSON values."""
    figures = {name: {"value": value, "unit": unit} for name, (value, unit) in comparison.figures().items()}
    return {"simulated": comparison.simulated, "figures": figures}
