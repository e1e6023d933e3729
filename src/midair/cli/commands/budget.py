"""The command `budget`: distortion that each stage of a reproduction adds."""

from dataclasses import replace
from pathlib import Path

from rich.table import Table

from midair import devices, files, rig
from midair.cli.comparisons import print_laboratory, print_palm, print_ratios, with_array_calibration
from midair.cli.console import banner, out, print_json, print_rows, progress_bars
from midair.cli.exposure_options import print_air
from midair.cli.options import (
    ArrayCalibration,
    Force,
    Json,
    Lead,
    PartLength,
    Seed,
    SolveOptions,
    Spread,
    StartAt,
    parse_quantity,
)
from midair.cli.output import may_write
from midair.errors import InputError
from midair.evaluate import Budget
from midair.figures import budget_figure, png_bytes
from midair.pipeline import required_lead


def budget_command(
    source: Path,
    figure: Path | None = None,
    /,
    *,
    options: SolveOptions | None = None,
    start_at: StartAt = 0.0,
    duration: PartLength = None,
    silencer: devices.SilencerChoice = "off",
    lead: Lead = None,
    lab: Path | None = None,
    array_calibration: ArrayCalibration = None,
    spread: Spread = "default",
    seed: Seed = 0,
    trade: str | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compute how much each stage of a virtual reproduction distorts: mapping, solver, hold, transducers, sensor.

    Stages are switched on one after another; those that follow are ideal.
    The signal-to-distortion ratio is computed in the band, cell by cell, after removing linear gain and delay.

    Parameters
    ----------
    source
        Recording with a calibration, NAME.h5.
    figure
        Write a waterfall chart of the stages to this PNG file.
    silencer
        How the array smooths phase steps, by default not at all.
    trade
        Instead, solve under each of these levels at the ears (110dB,120dB) in the mode quiet, and print what the palm
        gets. --gain or --strength is the highest.
    lab
        TOML file with the uncertainties of a laboratory, from midair doctor --lab: adds the part "palm and laboratory",
        the loss by each of them and by all together, in random draws from the seed.

    Examples
    --------
    $ midair budget take.h5 budget.png --duration 0.1s
    $ midair budget take.h5 --lab lab.toml
    """
    options = options or SolveOptions()
    levels = _levels(trade)
    if levels and getattr(options, "mode", None) is None and getattr(options, "settings_file", None) is None:
        options = replace(options, mode="quiet")
    settings = options.settings()
    if figure is not None:
        may_write(figure, force)
    original = rig.pressure_of(source, settings, start_at, duration)
    band = settings.calibration.band
    height = settings.target.grid.height
    virtual = rig.VirtualRig(cells=original.sensor, seed=seed, height=height, spread=spread).hearing(band)
    measured, settings, original = with_array_calibration(array_calibration, virtual.array, settings, original)
    stated = array_calibration is not None and str(array_calibration) != "none"
    known = files.load_array_calibration(array_calibration) if stated and array_calibration else None
    plan = rig.BudgetPlan(
        settings=settings,
        rig=virtual,
        measured=None if measured is virtual.array else measured,
        silencer=silencer,
        palm=options.outline(),
        lead=required_lead(settings) if lead is None else lead,
        laboratory=None if lab is None else files.load_laboratory(lab),
        calibration=known,
        seed=seed,
    )
    banner(True)
    print_air(settings.acoustics.medium, stated=options.air_is_stated)
    if levels:
        with progress_bars() as stage:
            rows = list(rig.level_trade(original, plan, levels, stage=stage))
        return print_json([row.plain() for row in rows]) if json else print_trade(source.name, rows)
    with progress_bars() as stage:
        made = rig.error_budget(
            original, plan, kept=rig.band_power_share(files.open_take(source).recording, band), stage=stage
        )
    if figure is not None:
        files.write_file(figure, png_bytes(budget_figure([(source.name, made)])))
    if json:
        return print_json(made.plain())
    print_budget(f"distortion of each stage, {source.name}", made)
    print_rows([("figure", str(figure))] if figure is not None else [])
    return None


def _levels(trade: str | None) -> list[float]:
    try:
        return [] if trade is None else [parse_quantity(each, "dB") for each in trade.split(",")]
    except ValueError as wrong:
        raise InputError(f"--trade: {wrong}") from None


def print_trade(name: str, rows: list[rig.LevelTrade]) -> None:
    """Print a row for each level at the ears."""
    table = Table(title=f"under a level at the ears, {name}", title_justify="left", box=None, pad_edge=False)
    for head in ("ears at most", "palm", "felt by", "touched cells", "ears", "bystander", "unlike"):
        table.add_column(head, justify="right")
    table.add_row("dB", "Pa", "of 10 people", "dB", "dB", "dB", "dB", style="dim")
    for row in rows:
        about, fewest, most = row.felt.people
        levels = (f"{each:.1f}" for each in (row.distortion_ratio, row.ears, row.bystander, row.unlike))
        table.add_row(f"{row.limit:g}", f"{row.palm:.2g}", f"{about} ({fewest} to {most})", *levels)
    out().print(table)
    print_rows(
        [
            ("palm", "highest radiation pressure"),
            ("felt by", "by four models of skin, not tried on people"),
            ("touched cells", "signal to distortion, without the sensor"),
            ("ears, bystander", "exposure check at 14 to 30 °C"),
            ("unlike", "sound at the ears by transducers that differ by 0.2 rad"),
        ]
    )


def print_budget(title: str, budget: Budget) -> None:
    """Print a row per stage, then what each stage is."""
    low, high = budget.band
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("stage")
    for head in ("alone", "touched cells", "all cells", "gain", "images", "place", "leak"):
        table.add_column(head, justify="right")
    table.add_row("", "dB", "dB", "dB", "", "dB", "", "%", style="dim")
    for each in budget.stages:
        so_far = each.so_far
        table.add_row(
            each.name,
            f"{each.alone.distortion_ratio:.1f}",
            f"{so_far.distortion_ratio:.1f}",
            f"{so_far.overall_ratio:.1f}",
            f"{so_far.gain:.2f}",
            "" if so_far.images is None else f"{so_far.images:.0f}",
            f"{so_far.spatial_correlation:.3f}",
            "" if each.leak is None else f"{100 * each.leak.peak:.0f}",
        )
    out().print(table)
    print_rows([(each.name, each.what) for each in budget.stages])
    out().print(f"\nafter the stage {budget.stages[-1].name}")
    print_ratios(budget.stages[-1].so_far.ratios)
    if budget.palm is not None:
        print_palm(budget.palm)
    if budget.laboratory is not None:
        print_laboratory(budget.laboratory)
    kept = "" if budget.kept is None else f"; {100 * budget.kept:.1f} % of the recording's power lies in the band"
    out().print(f"strength {budget.strength:.3f}, band {low:g} to {high:g} Hz{kept}")
