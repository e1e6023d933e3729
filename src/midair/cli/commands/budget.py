"""The command `budget`: distortion that each stage of a reproduction adds."""

from pathlib import Path

from midair import devices, files, rig
from midair.cli.comparisons import laboratory_lines, palm_lines, print_laboratory, with_array_calibration
from midair.cli.console import print_answer, print_grid, print_json, progress_bars
from midair.cli.exposure_options import print_air
from midair.cli.options import Force, Json, Reflection, Seed, Spread, TakeOptions
from midair.cli.output import may_write, print_table
from midair.errors import InputError
from midair.evaluate import RATIOS, Budget, StageLoss, ratio_text
from midair.figures import budget_figure, png_bytes
from midair.pipeline import required_lead
from midair.table import Details, Line


def budget_command(
    source: Path,
    figure: Path | None = None,
    /,
    *,
    options: TakeOptions | None = None,
    silencer: devices.SilencerChoice = "off",
    lab: Path | None = None,
    fixed_place: bool = False,
    spread: Spread = "default",
    reflection: Reflection = 0.0,
    seed: Seed = 0,
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
    lab
        TOML file with the uncertainties of a laboratory, from midair doctor --lab: adds the part "palm and laboratory",
        the loss by each of them and by all together, in random draws from the seed.
    fixed_place
        With --lab, count a shift and a turn of the palm in its plane as distortion.

    Examples
    --------
    $ midair budget take.h5 budget.png --duration 0.1s
    $ midair budget take.h5 --lab lab.toml --duration 0.1s
    """
    options = options or TakeOptions()
    settings = options.settings()
    if fixed_place and lab is None:
        raise InputError("--fixed-place: expected --lab beside it, got none")
    if figure is not None:
        may_write(figure, force, ".png")
    original = rig.pressure_of(source, settings, options.start_at, options.duration)
    height = settings.target.grid.height
    usual = rig.VirtualRig(cells=original.sensor, seed=seed, height=height, spread=spread, reflection=reflection)
    virtual = usual.hearing(settings.calibration.band)
    file = options.array_calibration
    measured, settings, original = with_array_calibration(file, virtual.array, settings, original)
    known = None if file is None or str(file) == "none" else files.load_array_calibration(file)
    plan = rig.BudgetPlan(
        settings=settings,
        rig=virtual,
        measured=None if measured is virtual.array else measured,
        silencer=silencer,
        palm=options.outline(),
        lead=required_lead(settings) if options.lead is None else options.lead,
        laboratory=None if lab is None else files.load_laboratory(lab),
        calibration=known,
        seed=seed,
        fixed_place=fixed_place,
    )
    print_air(settings.acoustics.medium, stated=options.air_is_stated)
    with progress_bars() as stage:
        made = rig.error_budget(original, plan, stage=stage)
    if figure is not None:
        files.write_file(figure, png_bytes(budget_figure([(source.name, made)])))
    if json:
        return print_json(made.plain())
    return print_budget(made, figure)


def print_budget(budget: Budget, figure: Path | None) -> None:
    """Print a row for each loss, the largest first, and with all lines what each stage is."""
    low, high = budget.band
    last, losses = budget.stages[-1], budget.losses()
    answer = f"{last.so_far.distortion_ratio:.1f} dB on the touched cells; the {losses[0][0].name} costs most"
    print_answer(answer, simulated=budget.simulated)
    rows = [
        (
            each.name,
            f"{loss:.1f}",
            f"{each.so_far.gain:.2f}",
            "" if each.leak is None else f"{100 * each.leak.peak:.0f} %",
        )
        for each, loss in losses
        if loss >= 0.05
    ]
    print_grid(("stage", "costs, dB", "gain so far", "beside the touch"), rows)
    table: list[Line] = [
        *([] if budget.palm is None else palm_lines(budget.palm)),
        *([] if budget.laboratory is None else laboratory_lines(budget.laboratory)),
        ("band", f"{low:g} to {high:g} Hz; costs are those of 60 dB"),
        ("left out", budget.left_out),
        ("figure", str(figure or "")),
        Details([*((each.name, _stage_text(each)) for each in budget.stages), ("strength", f"{budget.strength:.3f}")]),
        Details([(name, f"{ratio_text(limits)} dB; {RATIOS[name]}") for name, limits in last.so_far.ratios.items()]),
    ]
    print_table(table, json=False)
    if budget.laboratory is not None:
        print_laboratory(budget.laboratory)


def _stage_text(stage: StageLoss) -> str:
    alone, so_far = (f"{each.distortion_ratio:.1f}" for each in (stage.alone, stage.so_far))
    return f"{stage.what}; {alone} dB alone, {so_far} dB with all before it"
