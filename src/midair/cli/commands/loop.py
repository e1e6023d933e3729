"""The command `loop`: solve, play, re-record, correct, play again, compare, report."""

from dataclasses import replace
from pathlib import Path

from midair.cli.comparisons import plain, print_metrics, print_ratios, stated_array_calibration
from midair.cli.console import banner, print_figures, print_json, print_rows, progress_bars, verbosity
from midair.cli.exposure_options import ExposureOptions, print_air
from midair.cli.options import (
    ArrayCalibration,
    Force,
    Json,
    Lead,
    PartLength,
    SolveOptions,
    StartAt,
    options_from,
    settings_from,
)
from midair.cli.output import may_write, warn_level
from midair.errors import InputError
from midair.headroom import level_of
from midair.pipeline import required_lead
from midair.rig import Loop, Outcome, PlaySettings, check_passes, open_rig, pressure_of, write_report
from midair.rig import loop as go_round


@options_from(
    PlaySettings,
    *("device", "sensor", "calibration", "silencer", "placement", "seed"),
    device="Array to play on: virtual (array and sensor are simulated), or one of midair play, with --sensor.",
)
class RigOptions:
    """Array and sensor of the loop."""


def loop_command(
    source: Path,
    output: Path | None = None,
    /,
    *,
    rig: RigOptions | None = None,
    exposure: ExposureOptions | None = None,
    array_calibration: ArrayCalibration = None,
    options: SolveOptions | None = None,
    start_at: StartAt = 0.0,
    duration: PartLength = None,
    corrections: int = 1,
    iterate: int = 0,
    lead: Lead = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Solve, play, re-record, correct and compare a recording, and write a report.

    Parameters
    ----------
    source
        Recording with a calibration, NAME.h5.
    output
        Report to write, NAME.html. [default: name of the source]
    corrections
        Number of amplitude corrections, each followed by another playback; the paper makes one.
    iterate
        Maximum number of waveform corrections after that; stops early when the error no longer falls.

    Examples
    --------
    $ midair loop take.h5 report.html --start-at 0.4s
    """
    target = output or Path(source.name.removesuffix(source.suffix) + ".html")
    options = options or SolveOptions()
    settings = options.settings()
    options.refuse_idle_palm()
    may_write(target, force, ".html")
    original = pressure_of(source, settings, start_at, duration)
    # The exposure check uses a temperature given by option only: not a default, nor one from a settings file.
    room = settings.acoustics.medium if getattr(options, "temperature", None) is not None else None
    playing = settings_from(
        PlaySettings,
        rig or RigOptions(),
        exposure=(exposure or ExposureOptions()).choices(room),
        height=settings.target.grid.height,
        cells=original.sensor,
        band=settings.calibration.band,
    )
    opened = open_rig(settings=playing)
    if playing.device != "virtual" and (playing.sensor is None or playing.calibration is None):
        raise InputError(
            f"loop on {playing.device}: expected --sensor and its --calibration to re-record the array, got "
            f"{playing.sensor or 'no sensor'} and {'a' if playing.calibration else 'no'} calibration"
        )
    opened = replace(opened, measured=stated_array_calibration(array_calibration, playing.device, settings))
    banner(opened.array.simulated or original.provenance.simulated)
    print_air(settings.acoustics.medium, stated=options.air_is_stated)
    lead = required_lead(settings) if lead is None else lead
    # Every pass plays another drive, whose exposure is checked first.
    check_passes(corrections, iterate)
    with progress_bars() as stage, opened:
        loop = go_round(original, settings, opened, corrections=corrections, iterate=iterate, lead=lead, stage=stage)
        write_report(loop, target, commands=(verbosity().line,), progress=stage("draw"))
    _print(loop, target, json)


def _print(loop: Loop, target: Path, json: bool) -> None:
    outcome, made = Outcome.of(loop), loop.passes[-1].reproduction
    card = outcome.card
    level = level_of(made.solution, made.target, band=loop.settings.calibration.band)
    warn_level(level)
    if json:
        passes = [plain(one.comparison) | {"step": one.step} for one in loop.passes]
        went = {"passes": passes, "taken_back": loop.taken_back, "end": loop.end, "level": level.plain()}
        skin = {"perception": card and card.plain()["figures"], "verdict": outcome.verdict.plain()}
        simulated = loop.passes[-1].comparison.simulated
        return print_json({"report": str(target), "simulated": simulated, **went, **skin})
    figures = {f"pass {number + 1}": one.comparison.figures() for number, one in enumerate(loop.passes)}
    print_rows(outcome.verdict.rows())
    print_figures("before and after correction", figures)
    print_ratios(loop.passes[-1].comparison.ratios)
    if card is not None:
        print_metrics(card)
    ended = [("iteration", f"{loop.end}; {loop.taken_back} steps undone")] if loop.end else []
    silencer = str(loop.passes[-1].rerecorded.provenance.steps[-1].settings["silencer"])
    print_rows([*level.rows(), *ended, ("silencer", silencer), ("report", str(target))])
    return None
