"""The command `loop`: solve, play, re-record, correct, play again, compare, report."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from midair.cli.comparisons import comparison_lines, plain, stated_array_calibration, verdict_lines
from midair.cli.console import print_grid, progress_bars, verbosity
from midair.cli.exposure_options import ExposureOptions, print_air
from midair.cli.options import Force, Json, TakeOptions, options_from, settings_from
from midair.cli.output import may_write, pressure_lines, print_table
from midair.errors import InputError
from midair.evaluate import TOUCHED
from midair.pressure_level import level_of
from midair.rig import Outcome, PlaySettings, laboratory_of_loop, open_rig, pressure_of, write_report
from midair.rig import loop as go_round
from midair.table import Details, Line


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
    options: TakeOptions | None = None,
    corrections: int = 1,
    iterate: int = 0,
    fixed_place: bool = False,
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
    fixed_place
        Count a shift and a turn of the pattern in the plane of the palm as distortion, also in a corrected gain.

    Examples
    --------
    $ midair loop take.h5 report.html --start-at 0.4s
    """
    target = output or Path(source.name.removesuffix(source.suffix) + ".html")
    options = options or TakeOptions()
    settings = options.settings()
    options.refuse_idle_palm()
    may_write(target, force, ".html")
    original = pressure_of(source, settings, options.start_at, options.duration)
    # The exposure check uses a temperature given by option only: not a default, nor one from a settings file.
    room = None if options.temperature is None else settings.acoustics.medium
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
    opened = replace(opened, measured=stated_array_calibration(options.array_calibration, playing.device, settings))
    print_air(settings.acoustics.medium, stated=options.air_is_stated)
    passes: Any = {"corrections": corrections, "iterate": iterate, "lead": options.lead, "fixed_place": fixed_place}
    with progress_bars() as stage, opened:
        loop = go_round(original, settings, opened, stage=stage, **passes)
        outcome, laboratory = Outcome.of(loop), None
        if playing.device == "virtual":
            laboratory = laboratory_of_loop(loop, fixed_place=fixed_place, progress=stage("laboratory"))
            outcome = replace(outcome, verdict=replace(outcome.verdict, laboratory=laboratory))
        how: Any = {"beside": (outcome,), "laboratory": laboratory, "progress": stage("draw")}
        write_report(loop, target, source=str(source), commands=(verbosity().line,), **how)
    _print(outcome, target, json)


def _print(outcome: Outcome, target: Path, json: bool) -> None:
    loop, last = outcome.loop, outcome.loop.passes[-1]
    made, comparison = last.reproduction, last.comparison
    level = level_of(made.solution, made.target, band=loop.settings.calibration.band)
    card, (answer, others) = outcome.card, verdict_lines(outcome.verdict)
    silencer = str(last.rerecorded.provenance.steps[-1].settings["silencer"])
    table: list[Line] = [
        {"report": str(target), "passes": [plain(one.comparison) | {"step": one.step} for one in loop.passes]},
        {"taken_back": loop.taken_back, "end": loop.end},
        {"perception": card and card.plain()["figures"], "verdict": outcome.verdict.plain()},
        *others,
        *pressure_lines(level),
        ("iteration", f"{loop.end}; {loop.taken_back} steps undone" if loop.end else ""),
        ("report", str(target)),
        Details([("silencer", silencer), *comparison_lines(comparison, card)]),
    ]
    print_table(table, answer=answer, simulated=comparison.simulated, json=json)
    if not json:
        passes, of_verdict = [one.comparison for one in loop.passes], f"{TOUCHED}, without noise"
        rows = [
            ("alike, dB", *(f"{one.ratios.get(of_verdict, one.ratios[TOUCHED])[0]:.1f}" for one in passes)),
            *((name, *(f"{getattr(one, name):.3f}" for one in passes)) for name in ("gain", "correlation")),
        ]
        print_grid(("", *(f"pass {number + 1}" for number in range(len(passes)))), rows)
