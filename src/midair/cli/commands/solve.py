"""The command `solve`: compute a drive."""

from pathlib import Path

from midair import files, rig
from midair.cli.comparisons import unreproduced_rows, with_array_calibration
from midair.cli.console import banner, progress_bars
from midair.cli.exposure_options import print_air
from midair.cli.options import ArrayCalibration, Force, Json, Lead, PartLength, SolveOptions, StartAt
from midair.cli.output import may_write, print_table, reserved, solve_error, warn_level
from midair.headroom import level_of
from midair.settings import Settings
from midair.table import Line, Row
from midair.targets import frames_without_lead


def solve_command(
    source: Path,
    output: Path | None = None,
    /,
    *,
    options: SolveOptions | None = None,
    start_at: StartAt = 0.0,
    duration: PartLength = None,
    lead: Lead = None,
    placement: Path | None = None,
    device: str = "virtual",
    array_calibration: ArrayCalibration = None,
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
    placement
        TOML file with the places of AUTD3 units.
    device
        Array on which the drive will be played, as in midair play: its transducers and its stored calibration.

    Examples
    --------
    $ midair solve take.h5
    $ midair solve take.h5 part.drive.h5 --duration 0.1s --mode quick
    """
    options = options or SolveOptions()
    settings = options.settings()
    options.refuse_idle_palm()
    transducers = rig.transducers_of(device, None if placement is None else files.load_placement(placement))
    target = output or Path(source.name.removesuffix(source.suffix) + ".drive.h5")
    may_write(target, force, ".drive.h5")
    pressure = rig.pressure_to_solve(source, settings, start_at, duration, lead=lead)
    transducers, settings, pressure = with_array_calibration(
        array_calibration, transducers, settings, pressure, device=device
    )
    banner(pressure.provenance.simulated)
    print_air(settings.acoustics.medium, stated=options.air_is_stated)
    with reserved(target), progress_bars() as stage:
        wanted, solution = rig.solve_to_file(pressure, transducers, settings, target, progress=stage("solve"))
    level = level_of(solution, wanted, band=settings.calibration.band)
    inside = frames_without_lead(wanted.provenance, wanted.frames, wanted.rate)
    plays = solution.plays
    error = solve_error(solution, wanted)
    warn_level(level)
    frames, rate, silent = wanted.frames, wanted.rate, int((~plays).sum())
    table: list[Line] = [
        Row("drive", str(target), text=f"{target} for {transducers.name}, {transducers.count} transducers"),
        Row("frames", frames, text=f"{frames} at {rate:g} Hz, {silent} silent, {inside.start} of lead at either end"),
        {"lead_frames": inside.start, "rate_hz": rate, **error.plain(), "level": level.plain()},
        *level.rows(),
        {"not_reproduced": dict(pressure.provenance.last("not reproduced"))},
        *unreproduced_rows(pressure.provenance),
        Row("ears", settings.target.ears, key="ears_db", text=_ears_text(settings)),
        ("E", str(error)),
        ("solver", f"{settings.solver.name}, {solution.iterations[plays].mean():.1f} iterations a frame"),
    ]
    # The mark of a simulated recording is printed above.
    print_table(table, simulated=pressure.provenance.simulated if json else None, json=json)


def _ears_text(settings: Settings) -> str:
    """The level at the ears that a drive was solved for, and was checked to keep."""
    if settings.target.ears is None:
        return ""
    checked = "by the exposure check, at 14 to 30 °C, also if transducers differ by 0.2 rad"
    return f"at most {settings.target.ears:g} dB at ears and bystander {checked}"
