"""A comparison and its perceptual card, for people and for programs."""

from collections.abc import Sequence

from rich.table import Table

from midair.cli.terminal.console import out
from midair.errors import ShapeError
from midair.evaluate import Comparison, PalmFidelity, PerceptualMetrics, perceptual_metrics
from midair.model import PressureFrames
from midair.rig import Outcome, side_by_side


def card_of(original: PressureFrames, reproduced: PressureFrames) -> PerceptualMetrics | None:
    """The perceptual card; None for less than the 64 ms that its metrics need."""
    try:
        return perceptual_metrics(original, reproduced)
    except ShapeError:
        return None


def print_card(card: PerceptualMetrics) -> None:
    """Each figure over all cells, and what it means."""
    out().print(f"\n{card.verdict()}")
    out().print("what skin makes of it, over all cells")
    for each in card.figures:
        unit = f" {each.unit}" if each.unit else ""
        out().print(f"  {each.name}: {each.overall:.3g}{unit}", style="bold")
        out().print(f"    {each.meaning}")


def print_palm(palm: PalmFidelity) -> None:
    """What a whole palm gets, skin by skin."""
    out().print(f"\nwhat a whole palm gets, {palm.palm}", style="bold")
    out().print(f"  {100 * palm.outside:.3g} % of the power in the band lies outside the square of the sensor")
    out().print(f"  pressure {palm.pressure:.1f} dB over the palm, {palm.square:.1f} dB within the square")
    moved = ", ".join(f"{ratio:.1f} dB ({name})" for name, ratio in palm.displacement.items())
    out().print(f"  displacement {moved}")
    out().print("    signal over distortion of flat model skins; no person was asked", style="dim")


def print_side_by_side(outcomes: Sequence[Outcome]) -> None:
    """Figures of several ways of playing beside each other."""
    table = Table(title="side by side" if len(outcomes) > 1 else None, title_justify="left", box=None, pad_edge=False)
    table.add_column("", overflow="fold")
    for each in outcomes:
        table.add_column(each.name, overflow="fold")
    table.add_column("unit")
    for name, unit, *values in side_by_side(outcomes):
        table.add_row(name, *values, unit)
    out().print(table)


def plain(comparison: Comparison) -> dict[str, object]:
    """A comparison for JSON."""
    figures = {name: {"value": value, "unit": unit} for name, (value, unit) in comparison.figures().items()}
    return {"simulated": comparison.simulated, "figures": figures}
