"""The command `solve`: compute a drive."""

from pathlib import Path

from midair import files, rig
from midair.cli.comparisons import with_array_calibration
from midair.cli.console import progress_bars
from midair.cli.exposure_options import print_air
from midair.cli.options import Force, Json, Placement, SolvedFor, TakeOptions
from midair.cli.output import describe_drive, may_write, next_row, print_table
from midair.table import Line, Row, plain


def solve_command(
    source: Path,
    output: Path | None = None,
    /,
    *,
    options: TakeOptions | None = None,
    placement: Placement = None,
    device: SolvedFor = "virtual",
    force: Force = False,
    json: Json = False,
) -> None:
    """Compute transducer phases that reproduce a recording.

    Parameters
    ----------
    source
        Recording with a calibration, NAME.h5.
    output
        Drive to write, NAME.drive.h5. [default: name of the source]

    Examples
    --------
    $ midair solve take.h5
    $ midair solve take.h5 part.drive.h5 --duration 0.1s --mode quick
    """
    options = options or TakeOptions()
    settings = options.settings()
    options.refuse_idle_palm()
    transducers = rig.transducers_of(device, None if placement is None else files.load_placement(placement))
    target = output or Path(source.name.removesuffix(source.suffix) + ".drive.h5")
    may_write(target, force, ".drive.h5")
    pressure = rig.pressure_to_solve(source, settings, options.start_at, options.duration, lead=options.lead)
    transducers, settings, pressure = with_array_calibration(
        options.array_calibration, transducers, settings, pressure, device=device
    )
    print_air(settings.acoustics.medium, stated=options.air_is_stated)
    with progress_bars() as stage:
        rig.solve_to_file(pressure, transducers, settings, target, progress=stage("solve"))
    about, (feeling, *lines) = describe_drive(target)
    row = Row("drive", str(target), text=f"{target}, {about}")
    answer = f"predicted: {feeling.text}" if isinstance(feeling, Row) else "nothing plays"
    table: list[Line] = [plain([feeling]), row, *lines, next_row("play", target)]
    print_table(table, answer=answer, simulated=pressure.provenance.simulated, json=json)
