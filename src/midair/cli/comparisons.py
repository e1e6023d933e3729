"""Inputs and output of commands that compare."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

from rich.table import Table

from midair.cli.console import out, print_note
from midair.errors import ShapeError
from midair.evaluate import Comparison, PalmFidelity, PerceptualMetrics, perceptual_metrics
from midair.files import load_array_calibration, open_take
from midair.model import PressureFrames, Provenance, TransducerArray
from midair.pipeline import calibrated_pressure
from midair.rig import Outcome, calibration_age, comparison_rows, kept_array_calibration
from midair.settings import Settings
from midair.streaming import TempFrames, blocks


def calibrated_part(
    source: Path, settings: Settings, start: float = 0.0, duration: float | None = None, *, streamed: bool = False
) -> PressureFrames:
    """Calibrated pressure of a part (lazy frames if `streamed`), cut after calibration so that filters leave no
    edges.
    """
    take = open_take(source, streamed=streamed)
    pressure = calibrated_pressure(take.recording, take.calibration, settings)
    return pressure if start == 0 and duration is None else pressure.cut(start, duration)


@contextmanager
def cached_pressure(pressure: PressureFrames) -> Generator[PressureFrames]:
    """The same pressure, computed once into a temporary file, inside the block."""
    with TempFrames(*pressure.sensor.shape) as spool:
        for block in blocks(pressure.pressure):
            spool.append(block)
        # The field is typed as an array; functions that accept lazy frames declare it.
        yield replace(pressure, pressure=cast("Any", spool.reel()))


def with_array_calibration(
    path: Path | None, array: TransducerArray, settings: Settings, pressure: PressureFrames, *, device: str = "virtual"
) -> tuple[TransducerArray, Settings, PressureFrames]:
    """Array, settings and pressure for measured transducers: of a file, or those stored for a device if `path` is None.

    Unchanged if there are none, or if the path is ``none``. Prints the age of the calibration.
    """
    kept = kept_array_calibration(device) if path is None else None
    if kept is not None:
        path, known, checked = kept.path, kept.known, f"; checked on {kept.checked}" if kept.checked else ""
    elif path is None or str(path) == "none":
        return array, settings, pressure
    else:
        known, checked = load_array_calibration(path), ""
    medium, height = settings.acoustics.medium, settings.target.grid.height
    age = calibration_age(known, today=datetime.now(UTC).date(), medium=medium, height=height)
    print_note(f"array calibration: {path.name} ({known.identifier}), {age}{checked}")
    told = {"file": path.name, "id": known.identifier, "date": known.date}
    life = pressure.provenance.then("array calibration", told, simulated=known.provenance.simulated)
    return known.applied(array), settings.measured(known), replace(pressure, provenance=life)


def settings_of_rerecording(provenance: Provenance, settings: Settings) -> Settings:
    """Settings with the band and rate of the drive of a re-recording."""
    band, rate = provenance.last("calibrate").get("band_hz"), provenance.last("play").get("rate_hz")
    if isinstance(band, tuple) and len(band) == 2:
        low, high = (float(edge) for edge in band if isinstance(edge, int | float))
        settings = settings.but(band=(low, high))
    return settings.but(rate=float(rate)) if isinstance(rate, int | float) else settings


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
