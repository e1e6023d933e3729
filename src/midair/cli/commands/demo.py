"""The command `demo`: record, solve, play and compare on a virtual rig in two modes, and write a report."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from midair import rig
from midair.cli.comparisons import laboratory_lines, palm_lines, print_laboratory
from midair.cli.console import confirmed, print_answer, print_grid, progress_bars, verbosity
from midair.cli.exposure_options import print_air
from midair.cli.options import Force, Seed, SolveOptions, Time
from midair.cli.output import next_row, print_table
from midair.errors import InputError
from midair.evaluate import LaboratoryLoss
from midair.files import check_not_recording, save, save_solution
from midair.model import Progress
from midair.rig import loop as go_round
from midair.settings import paper_mode
from midair.table import Details, Line

_STROKE = 1.28
"""Duration of a virtual stroke over the whole sensor, in s."""


def demo_command(
    output: Path = Path("demo"),
    /,
    *,
    object_name: str = "towel",
    start_at: Time = 0.4,
    duration: Time = 0.5,
    options: SolveOptions | None = None,
    seed: Seed = 0,
    force: Force = False,
) -> None:
    """Record a virtual towel stroke, reproduce it in the best mode and in the paper's, and write a report.

    Needs no hardware; all results are marked SIMULATED.
    The virtual sensor has sixteen microphones under a gel.
    The virtual array has four AUTD3 units whose transducers deviate from the solver's model.
    The paper's mode uses the fast solver glide; --mode paper runs only this mode, with its own slow solver.

    Parameters
    ----------
    output
        Folder for report, recordings and drive. Asks before it replaces an earlier demo.
    object_name
        Object of the stroke: brush, sponge or towel; add +groove for the grooved sensor surface.
    start_at
        Start of the part to reproduce; at the default the object has reached the second row of cells.
    duration
        Length of the part to reproduce.

    Examples
    --------
    $ midair demo
    $ midair demo sponge --object-name sponge
    """
    options = options or SolveOptions()
    settings = options.settings()
    if output.is_file():
        raise InputError(f"{output}: expected a folder, got a file; give another name")
    replaces = (output / "report.html").exists() and not force
    if replaces and not confirmed(f"{output} contains an earlier demo. Overwrite it?"):
        raise InputError(f"{output}: contains an earlier demo; give another folder, or --force to overwrite it")
    virtual = rig.VirtualRig(seed=seed, height=settings.target.grid.height)
    touched_by = virtual.touched_by(object_name)
    if not (0 <= start_at < start_at + duration <= _STROKE):
        raise InputError(
            f"--start-at, --duration: expected a part within {_STROKE} s, got {duration:g} s from {start_at:g} s on"
        )
    output.mkdir(parents=True, exist_ok=True)
    check_not_recording(stroke := output / "stroke.h5")
    stroke.unlink(missing_ok=True)
    print_air(settings.acoustics.medium, stated=options.air_is_stated)
    ways = {options.mode_name: settings}
    if options.mode != "paper":
        # By glide: the paper's own solver takes seven times as long for the same distortion on the sensor.
        like = {"band": settings.calibration.band, "grid": settings.target.grid, "acoustics": settings.acoustics}
        ways["the paper's mode"] = paper_mode().but(method="glide", jobs=settings.solver.jobs, **like)
    with progress_bars() as stage:
        with touched_by as touched:
            notes = {"object": object_name}
            take = rig.record(touched, _STROKE, path=stroke, notes=notes, progress=stage("record"))
        outcomes = list[rig.Outcome]()
        for name, each in ways.items():
            original = rig.pressure_of(take, each, start_at, duration)
            with rig.open_rig("virtual", height=virtual.height, seed=seed) as opened:
                # The model predicts the level of the first pass, except behind a rectifier.
                corrections = each.target.mapping == "half-wave"
                loop = go_round(original, each, opened, corrections=corrections, stage=stage)
            palm = rig.palm_of_loop(loop, virtual, options.outline(), progress=stage("palm"))
            outcomes.append(rig.Outcome.of(loop, palm=palm, name=name))
        laboratory = rig.laboratory_of_loop(outcomes[0].loop, progress=stage("laboratory"))
        outcomes[0] = replace(outcomes[0], verdict=replace(outcomes[0].verdict, laboratory=laboratory))
        _write_files(outcomes, output, object_name, laboratory, stage("draw"))
    _print(outcomes, output, laboratory)


def _write_files(
    outcomes: list[rig.Outcome], output: Path, object_name: str, laboratory: LaboratoryLoss, progress: Progress
) -> None:
    """Write drive and re-recording of the first mode, and the report, into the folder."""
    loop = outcomes[0].loop
    last = loop.passes[-1]
    save_solution(last.reproduction.solution, output / f"{object_name}.drive.h5", target=last.reproduction.target)
    save(last.rerecorded, output / "rerecorded.h5", force=True)
    how: Any = {"beside": outcomes, "laboratory": laboratory, "progress": progress}
    rig.write_report(
        loop, output / "report.html", source=str(output / "stroke.h5"), commands=(verbosity().line,), **how
    )


def _print(outcomes: list[rig.Outcome], output: Path, laboratory: LaboratoryLoss) -> None:
    print_answer("a touch, recorded, played in midair and recorded again", simulated=True)
    columns = [dict(each.verdict.rows()) for each in outcomes]
    rows = [
        *((name, *(column.get(name, "") for column in columns)) for name in columns[0] if name != "laboratory"),
        ("beside", *(f"{100 * each.palm.outside:.0f} % of the power" if each.palm else "" for each in outcomes)),
    ]
    print_grid(("", *(each.name for each in outcomes)), rows)
    table: list[Line] = [
        *laboratory_lines(laboratory),
        Details(
            [(row[0], ", ".join(f"{value} {row[1]}" for value in row[2:])) for row in rig.comparison_rows(outcomes)]
        ),
        *([] if outcomes[0].palm is None else palm_lines(outcomes[0].palm)[1:]),
        ("report", str(output / "report.html")),
        next_row("studio", output),
    ]
    print_table(table, json=False)
    if verbosity().all:
        print_laboratory(laboratory)
