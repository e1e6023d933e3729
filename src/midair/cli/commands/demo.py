"""The command `demo`: the whole pipeline on a virtual rig, ending in a report."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

from midair.cli.terminal import (
    Force,
    SolveOptions,
    Time,
    banner,
    err,
    level_rows,
    out,
    print_figures,
    print_palm,
    print_rows,
    quantity,
    say_air,
    stages,
)
from midair.errors import InputError
from midair.evaluate import PalmFidelity
from midair.files import check_unclaimed, save, save_solution, whole_file
from midair.flow import felt
from midair.headroom import level_of
from midair.rig import Loop, VirtualRig, capture_recording, open_rig, palm_of_loop, write_report
from midair.rig import loop as go_round
from midair.targets import piece_of

_STROKE = 1.28
"""Duration of a virtual stroke over the whole sensor, in s."""


def demo_command(
    output: Path = Path("demo"),
    /,
    *,
    object_name: str = "towel",
    start_at: Time = 0.4,
    duration: Annotated[float, quantity("s")] = 0.5,
    options: SolveOptions | None = None,
    seed: int = 0,
    force: Force = False,
) -> None:
    """Record a virtual towel stroke, reproduce it on a virtual array, re-record, correct, compare, and report.

    Needs no hardware. The sensor is a model of sixteen microphones under a gel, the array one of four AUTD3 units, each
    a little different from what the solver assumes; everything that comes out says SIMULATED.

    Parameters
    ----------
    output
        Folder for the report, the recordings and the drive. Before an earlier demo is replaced, you are asked.
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
    _ask_to_write_over(output, force)
    rig = VirtualRig(seed=seed, height=settings.target.grid.height)
    touched_by = rig.touched_by(object_name)
    if not (0 <= start_at < start_at + duration <= _STROKE):
        raise InputError(
            f"--start-at, --duration: expected a part of {_STROKE} s, got {duration:g} s from {start_at:g} s on"
        )
    output.mkdir(parents=True, exist_ok=True)
    check_unclaimed(output / "stroke.h5")
    (output / "stroke.h5").unlink(missing_ok=True)
    out().print(f"sensor: none found, virtual {object_name} on {rig.sensor_model.grid.name}")
    out().print(f"array: none found, virtual {rig.array.name} units, {rig.array.count} transducers")
    banner(True)
    say_air(settings.acoustics.medium, stated=options.air_is_stated)
    with stages() as stage:
        with touched_by as touched:
            recording = capture_recording(
                touched, _STROKE, path=output / "stroke.h5", notes={"object": object_name}, progress=stage("record")
            )
        original = felt(recording, touched.calibration, settings).cut(start_at, duration)
        with open_rig("virtual", height=settings.target.grid.height, seed=seed) as opened:
            loop = go_round(original, settings, opened, stage=stage)
    same = [] if seed == 0 else ["--seed", str(seed)]
    part = ["--start-at", f"{start_at!r}s", "--duration", f"{duration!r}s"]
    commands = (
        ["midair", "record", f"virtual:{object_name}", "stroke.h5", "--duration", f"{_STROKE}s", *same],
        ["midair", "loop", "stroke.h5", "report.html", *part, *options.typed(), *same],
    )
    palm = palm_of_loop(loop, rig)
    _keep(loop, output, object_name, tuple(shlex.join(words) for words in commands), palm)
    print_figures(
        "before and after correction", {f"pass {n + 1}": one.comparison.figures() for n, one in enumerate(loop.passes)}
    )
    print_palm(palm)
    last = loop.passes[-1].reproduction
    inside = piece_of(last.target.provenance, last.target.frames, last.target.rate)
    warm = int(last.solution.iterations[1:].max(initial=0))
    print_rows(
        [
            (
                "solver",
                f"{settings.solver.name}, at most {warm} iterations a frame, {last.target.frames} frames",
            ),
            (
                "E",
                f"{100 * last.solution.error[inside].mean():.1f} % of what is met ({settings.solver.fit}), on average",
            ),
            *level_rows(level_of(last.solution, last.target, band=settings.calibration.band)),
            ("report", str(output / "report.html")),
        ]
    )


def _ask_to_write_over(output: Path, force: bool) -> None:
    """Let a person decide about what an earlier demo left; nobody to ask means no."""
    if force or not (output / "report.html").exists():
        return
    if sys.stdin.isatty():
        err().print(f"{output} holds an earlier demo. Write over it? [y/N] ", end="")
        if sys.stdin.readline().strip().lower() in ("y", "yes"):
            return
    raise InputError(f"{output}: holds an earlier demo; give another folder, or --force to write over it")


def _keep(loop: Loop, output: Path, name: str, commands: tuple[str, ...], palm: PalmFidelity) -> None:
    """Write everything that came of the loop into the folder."""
    last = loop.passes[-1]
    save_solution(last.reproduction.solution, output / f"{name}.drive.h5", target=last.reproduction.target)
    save(last.rerecorded, output / "rerecorded.h5")
    shown = write_report(loop, output / "report.html", commands=commands, palm=palm)
    with whole_file(output / "field.png") as partial:
        partial.write_bytes(shown[2].data)
