"""The command `draw`: a pattern of moving foci as a drive."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from midair import files, rig
from midair.cli.console import progress_bars
from midair.cli.exposure_options import AirOptions
from midair.cli.options import ArrayCalibration, Force, Json, OptionalTime, Placement, SolvedFor, quantity
from midair.cli.output import as_recording, describe_drive, may_write, next_row, parameter_values, print_table
from midair.model import Calibration
from midair.patterns import draw_file, load_pattern, wanted_pressure
from midair.table import Line, Row, plain


def draw_command(
    source: Path,
    output: Path | None = None,
    /,
    *,
    duration: OptionalTime = None,
    parameter: tuple[str, ...] = (),
    pressure: Annotated[float, quantity("Pa")] = 50.0,
    wanted: Annotated[Path | None, Parameter(alias="-w")] = None,
    placement: Placement = None,
    device: SolvedFor = "virtual",
    array_calibration: ArrayCalibration = None,
    air: AirOptions | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compute the drive of a pattern: foci that move and change their pressure.

    One focus is computed in closed form, several at once by GS-PAT and Levenberg-Marquardt.

    Parameters
    ----------
    source
        Pattern to draw, NAME.toml, or NAME.adaptics of the AdapTics Designer.
    output
        Drive to write, NAME.drive.h5. [default: named as the source]
    duration
        Length of the drive; a loop needs one. [default: one pass]
    parameter
        Value of a named parameter of the pattern, such as size=20; may be given several times.
    pressure
        Pressure of intensity 1 in an .adaptics file.
    wanted
        Write the wanted pressure on 4 x 4 cells too, a recording to compare with what is played.

    Examples
    --------
    $ midair draw circle.toml
    $ midair draw circle.toml circle.drive.h5 --duration 2s --wanted circle.h5
    $ midair draw rain.adaptics --duration 0.5s --parameter droplet_strength=0.5
    """
    target = output or Path(source.name.removesuffix(source.suffix) + ".drive.h5")
    may_write(target, force, ".drive.h5")
    if wanted is not None:
        may_write(wanted, force, ".h5")
    values = parameter_values(parameter)
    pattern = load_pattern(source, values, pressure=pressure)
    foci = pattern.foci(duration)
    units = None if placement is None else files.load_placement(placement)
    transducers = rig.measured_transducers(device, units, array_calibration)
    medium = (air or AirOptions()).assumed()
    with progress_bars() as stage:
        used = draw_file(foci, source, target, transducers, chosen=values, medium=medium, progress=stage("draw"))
    solution, stored = files.load_solution(target, streamed=True), files.load_target(target, streamed=True)
    if wanted is not None and stored is not None:
        cells = wanted_pressure(stored, medium)
        files.save(as_recording(cells), wanted, calibration=Calibration.flat(cells.sensor, sensitivity=1.0, unit="Pa"))
    seconds, loudest = foci.frames / foci.rate, float(foci.pressure.max())
    about, (feeling, *_) = describe_drive(target)
    count, error = foci.pressure.shape[1], float(solution.error.max())
    each = f"{count}, up to {loudest:.4g} Pa each, {100 * used:.0f} % of what one focus can do there"
    of_foci = f"{100 * error:.2g} % at most, of the sound amplitude at the foci" if count > 1 else ""
    table: list[Line] = [
        Row("drive", str(target), text=f"{target}, {about}"),
        {"frames": foci.frames, "rate_hz": foci.rate, "duration_s": seconds},
        Row("foci", count, text=each),
        {"pressure_pa": loudest, "reach_used": used},
        Row("E", error, key="error", text=of_foci),
        ("wanted", "" if wanted is None else f"{wanted}, pressure on 4 x 4 cells"),
        next_row("play", target),
    ]
    answer = f"predicted: {feeling.text}" if isinstance(feeling, Row) else "nothing plays"
    print_table([plain([feeling]), *table], answer=answer, json=json)
