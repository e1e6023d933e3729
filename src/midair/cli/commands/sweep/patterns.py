"""The command `sweep patterns`: solve many binary patterns in parallel."""

from dataclasses import replace
from typing import Annotated

from cyclopts import Parameter

from midair.cli.commands.sweep.output import Bits, Scheduler, Store, Workers, run_with_bar, show_patterns
from midair.cli.console import out
from midair.cli.exposure_options import AirOptions
from midair.cli.quantities import quantity
from midair.model import HEIGHT, Acoustics, Directivity, Medium
from midair.sweep import PatternResults, PatternSweep, load_sweep, report_of

Numbers = Annotated[tuple[float, ...], Parameter(consume_multiple=True)]
Lengths = Annotated[tuple[float, ...], quantity("m", many=-1), Parameter(consume_multiple=True, metavar="QUANTITIES")]


def patterns_command(
    output: Store,
    /,
    *,
    strength: Numbers = (0.1, 0.2),
    height: Lengths = (HEIGHT,),
    count: int = 65535,
    curve_strength: Numbers = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4),
    curve_height: Lengths = (0.15, 0.175, 0.2, 0.225, 0.25, 0.275, 0.3),
    curves: int = 512,
    seed: int = 2024,
    method: str = "fast",
    iterations: int | None = None,
    directivity: Directivity = "point",
    attenuation: float | None = None,
    air: AirOptions | None = None,
    bits: Bits = 8,
    chunk: int = 512,
    scheduler: Scheduler = None,
    workers: Workers = None,
) -> int:
    """Solve binary 4 x 4 patterns at each strength and height, or resume an interrupted sweep.

    The defaults are the paper's experiment 5.1: all 65535 patterns, point sources, no attenuation.
    Results are stored in a Zarr group as they are computed; run the same command again to resume.

    Parameters
    ----------
    strength
        Target peak relative to a single focus of the whole array.
    height
        Height of the control points above the array.
    count
        Number of patterns, drawn with the seed; 65535 is all.
    curve_strength
        Strengths for the curve of E over strength, at the first height.
    curve_height
        Heights for the curves of E over height, at each strength.
    curves
        Number of patterns for the curves; 0 for no curves.
    seed
        Random seed of the order of the patterns.
    method
        Solver, as in midair solve.
    iterations
        Maximum iterations of the solver. [default: that of the solver]
    directivity
        Directivity of a transducer.
    attenuation
        Attenuation of sound in air, in Np/m. [default: 0, or that of the stated air]
    air
        Air, given by its temperature. [default: the paper's 340 m/s]
    chunk
        Patterns per task; a killed process loses at most one task.

    Examples
    --------
    $ midair sweep patterns patterns.zarr --count 1000 --strength 0.1
    """
    medium = (air or AirOptions()).medium() or Medium(attenuation=0.0)
    if attenuation is not None:
        medium = replace(medium, attenuation=attenuation)
    sweep = PatternSweep(
        strengths=strength,
        heights=height,
        count=count,
        curve_strengths=curve_strength,
        curve_heights=curve_height,
        curve_count=curves,
        seed=seed,
        method=method,
        iterations=iterations,
        acoustics=Acoustics(medium=medium, directivity=directivity),
        bits=bits,
        chunk=chunk,
    )
    status = run_with_bar(sweep, output, scheduler=scheduler, workers=workers)
    if status == 0:
        show_patterns(report_of(PatternResults.of(load_sweep(output))))
        out().print(f"Next: midair sweep report {output}")
    return status
