"""The command `compare`: a re-recording against its original."""

from pathlib import Path

from midair.cli.app import app
from midair.cli.terminal.console import banner, out, print_figures, print_json
from midair.cli.terminal.options import BandOptions
from midair.cli.terminal.originals import felt_part, made_with, same_part
from midair.errors import ShapeError
from midair.evaluate import Comparison, PerceptualCard, compare, perceptual_card
from midair.files import load
from midair.model import PressureFrames


@app.command(name="compare")
def compare_command(
    original: Path,
    reproduced: Path,
    /,
    *,
    options: BandOptions | None = None,
    json: bool = False,
) -> None:
    """Compare a re-recording with its original: waveform, spectrum, level, place, delay, and what skin makes of it.

    Band, rate, and the part of the original that was played are those that the re-recording says it was made with.

    Parameters
    ----------
    original
        A recording with a calibration.
    reproduced
        What was re-recorded of its reproduction.
    options
        Of the band, where the re-recording does not say.
    json
        Print JSON for a program.
    """
    again = load(reproduced)
    settings = made_with(again.provenance, (options or BandOptions()).settings())
    before = same_part(felt_part(original, settings), again.provenance)
    after = felt_part(reproduced, settings)
    comparison, card = compare(before, after), card_of(before, after)
    if json:
        return print_json(plain(comparison) | {"perception": None if card is None else card.plain()["figures"]})
    banner(comparison.simulated)
    print_figures(f"{reproduced.name} against {original.name}", {"": comparison.figures()})
    if card is not None:
        print_card(card)
    return None


def card_of(original: PressureFrames, reproduced: PressureFrames) -> PerceptualCard | None:
    """The perceptual card; None for less than the 64 ms that its metrics need."""
    try:
        return perceptual_card(original, reproduced)
    except ShapeError:
        return None


def print_card(card: PerceptualCard) -> None:
    """Each figure over all cells, and what it means."""
    out().print("\nwhat skin makes of it, over all cells")
    for each in card.figures:
        unit = f" {each.unit}" if each.unit else ""
        out().print(f"  {each.name}: {each.overall:.3g}{unit}", style="bold", markup=False)
        out().print(f"    {each.meaning}", markup=False)


def plain(comparison: Comparison) -> dict[str, object]:
    """A comparison for JSON."""
    figures = {name: {"value": value, "unit": unit} for name, (value, unit) in comparison.figures().items()}
    return {"simulated": comparison.simulated, "figures": figures}
