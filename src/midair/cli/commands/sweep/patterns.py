"""Commands for sweeps: many patterns on many processes, and what came out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from cyclopts import Parameter, Token

from midair.cli.terminal import AirOptions, out, parse_quantity, show_patterns, spell, swept
from midair.model import Acoustics, Directivity, Medium
from midair.sweep import PatternResults, PatternSweep, load_sweep, report_of


def _lengths(_: Any, tokens: Sequence[Token]) -> tuple[float, ...]:
    return tuple(parse_quantity(token.value, "m") for token in tokens)


def _spelt(values: tuple[float, ...]) -> str:
    return " ".join(spell(value, "m") for value in values)


Numbers = Annotated[tuple[float, ...], Parameter(consume_multiple=True)]
Lengths = Annotated[
    tuple[float, ...],
    Parameter(converter=_lengths, n_tokens=-1, consume_multiple=True, show_default=_spelt, metavar="QUANTITIES"),
]


def patterns_command(
    output: str,
    /,
    *,
    strength: Numbers = (0.1, 0.2),
    height: Lengths = (0.2,),
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
    bits: int = 8,
    chunk: int = 512,
    scheduler: str | None = None,
    workers: int | None = None,
) -> int:
    """Solve binary 4 x 4 patterns at each strength and height; go on where it was interrupted.

    The paper's experiment 5.1: all 65535 patterns, point sources, no attenuation. Results go into a Zarr group as they
    come. Stopped or killed, the same command goes on without doing anything twice.

    Parameters
    ----------
    output
        NAME.zarr, new or of the same sweep; also an address that fsspec knows.
    strength
        Peak of the target over the focus of the whole array.
    height
        Of the control points above the array.
    count
        How many patterns, drawn with the seed; 65535 is all.
    curve_strength
        Strengths of the curve of E over strength, at the first height.
    curve_height
        Heights of the curves of E over height, at each strength.
    curves
        How many patterns are behind the curves; 0 for no curves.
    seed
        Of the order of the patterns.
    method
        The solver, as in midair solve.
    iterations
        Of the solver; its own if not given.
    directivity
        Of a transducer.
    attenuation
        Of the air, in Np/m; none, or that of the stated air, if not given.
    air
        Stated by its temperature; the paper's 340 m/s if it is not.
    bits
        To which phases are rounded for the second E.
    chunk
        Patterns a task: what a kill may cost each process.
    scheduler
        Address of a Dask scheduler, such as tls://host:8786; processes on this machine if not given.
    workers
        Processes on this machine; one a core if not given.

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
    status = swept(sweep, output, scheduler=scheduler, workers=workers)
    if status == 0:
        show_patterns(report_of(PatternResults.of(load_sweep(output))))
        out().print(f"Next: midair sweep report {output}")
    return status
