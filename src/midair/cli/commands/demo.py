"""The command `demo`: the whole pipeline on a virtual rig, ending in a report."""

from pathlib import Path
from typing import Annotated

from midair.cli.terminal import (
    SolveOptions,
    Time,
    banner,
    level_rows,
    out,
    print_figures,
    print_rows,
    quantity,
    say_air,
    stages,
)
from midair.files import check_unclaimed, save, save_solution, whole_file
from midair.flow import felt, lead_of
from midair.headroom import level_of
from midair.rig import Loop, VirtualRig, capture_recording, run_loop, write_report


def demo_command(
    output: Path = Path("demo"),
    /,
    *,
    object_name: str = "towel",
    start_at: Time = 0.4,
    duration: Annotated[float, quantity("s")] = 0.5,
    options: SolveOptions | None = None,
    seed: int = 0,
) -> None:
    """Record a virtual towel stroke, reproduce it on a virtual array, re-record, correct, compare, and report.

    Needs no hardware. The sensor is a model of sixteen microphones under a gel, the array one of four AUTD3 units, each
    a little different from what the solver assumes; everything that comes out says SIMULATED.

    Parameters
    ----------
    output
        Folder for the report, the recordings and the drive; those of an earlier demo are replaced.
    object_name
        brush, sponge or towel, each with +groove for the grooved sensor surface.
    start_at
        Where in the stroke to begin; the object has reached the second row of cells by then.
    duration
        How much of the stroke to reproduce.
    options
        Of every stage.
    seed
        Of everything random.

    Examples
    --------
    $ midair demo
    $ midair demo sponge --object-name sponge
    """
    options = options or SolveOptions()
    settings = options.settings()
    output.mkdir(parents=True, exist_ok=True)
    check_unclaimed(output / "stroke.h5")
    (output / "stroke.h5").unlink(missing_ok=True)
    rig = VirtualRig(seed=seed, height=settings.target.grid.height)
    out().print(f"sensor: none found, virtual {object_name} on {rig.sensor_model.grid.name}")
    out().print(f"array: none found, virtual {rig.array.name} units, {rig.array.count} transducers")
    banner(True)
    say_air(settings.acoustics.medium, stated=options.air_is_stated)
    with stages() as stage:
        with rig.touched_by(object_name) as touched:
            recording = capture_recording(
                touched, 1.28, path=output / "stroke.h5", notes={"object": object_name}, progress=stage("record")
            )
        original = felt(recording, touched.calibration, settings).cut(start_at, duration)
        skin = rig.skin()
        with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
            loop = run_loop(original, array, sensor, settings, lead=lead_of(settings), stage=stage)
    _keep(loop, output, object_name, f"--start-at {start_at:g}s --duration {duration:g}s")
    print_figures(
        "before and after correction", {f"pass {n + 1}": one.comparison.figures() for n, one in enumerate(loop.passes)}
    )
    last = loop.passes[-1].reproduction
    warm = int(last.solution.iterations[1:].max(initial=0))
    print_rows(
        [
            (
                "solver",
                f"{settings.solver.name}, at most {warm} iterations a frame, {last.target.frames} frames",
            ),
            (
                "E",
                f"{100 * last.solution.error.mean():.1f} % on average, the paper reports 5 to 15 % for static patterns",
            ),
            *level_rows(level_of(last.solution, last.target, band=settings.calibration.band)),
            ("report", str(output / "report.html")),
        ]
    )


def _keep(loop: Loop, output: Path, name: str, part: str) -> None:
    """Write everything that came of the loop into the folder."""
    last = loop.passes[-1]
    save_solution(last.reproduction.solution, output / f"{name}.drive.h5", target=last.reproduction.target)
    save(last.rerecorded, output / "rerecorded.h5")
    commands = (
        f"midair record virtual:{name} stroke.h5",
        f"midair loop stroke.h5 report.html {part}",
    )
    shown = write_report(loop, output / "report.html", commands=commands)
    with whole_file(output / "field.png") as partial:
        partial.write_bytes(shown[2].data)
