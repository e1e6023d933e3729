"""The commands `sweep patterns`, `sweep recordings` and `sweep report`: solve many targets in parallel."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import App, CycloptsError, Parameter

from midair.cli.console import err, out, print_answer, print_grid, print_json, progress_bars
from midair.cli.exposure_options import AirOptions, print_air
from midair.cli.help_text import add_command, epilogue
from midair.cli.options import Json, OptionalTime, SolveOptions, Time, quantity
from midair.errors import InputError
from midair.files import open_take
from midair.model import HEIGHT, Acoustics, Directivity, Medium, TransducerArray
from midair.pipeline import calibrated_pressure, with_fitted_gain
from midair.sweep import (
    PatternSweep,
    RecordingSweep,
    Sweep,
    SweepResults,
    SweepTrial,
    load_sweep,
    run_sweep,
    sweep_report,
    write_sweep_report,
)

_SCHEDULER = "Address of a Dask scheduler, such as tls://host:8786. [default: processes on this computer]"
Folder = Annotated[Path, Parameter(help="Folder of the results, new or of the same sweep.")]
Bits = Annotated[int, Parameter(help="Bits to which phases are rounded for the second E.")]
Scheduler = Annotated[str | None, Parameter(help=_SCHEDULER)]
Workers = Annotated[int | None, Parameter(help="Processes on this computer. [default: one per core]")]


def solve_and_show(sweep: Sweep, folder: Path, *, scheduler: str | None, workers: int | None) -> int:
    """Run a sweep with a progress bar, print its report, and return the exit status."""
    try:
        with progress_bars("patterns" if sweep.kind == "patterns" else "frames", period=120) as stage:
            run_sweep(sweep, folder, scheduler=scheduler, workers=workers, progress=stage("sweep"))
    except KeyboardInterrupt:
        err().print("midair: stopped; the results so far are stored; run the same command again to resume")
        return 130
    show_report(load_sweep(folder))
    out().print(f"Next: midair sweep report {folder}", soft_wrap=True)
    return 0


def show_report(results: SweepResults) -> None:
    """Print the conditions or trials, progress and cost."""
    tables = sweep_report(results)
    texts = ("recording", "variant") if "trials" in tables else ()
    numbers = ("frames", "strength") if texts else ("strength", "height_mm", "patterns")
    bits = f"{results.settings['bits']}-bit"
    shares = {"mean": "mean", "p95": "95 %", "worst": "worst"}
    shares |= {"mean_rounded": f"{bits} mean", "worst_rounded": f"{bits} worst"}
    known = np.isfinite(results.error).sum()
    each = "" if texts else ", each pattern at each strength and height"
    missing = "" if results.complete else ", continue with the same command"
    took = f"{results.seconds:.0f} s of processor time, {1e3 * results.seconds / known:.2f} ms each"
    print_answer(f"{known} {'frames' if texts else 'targets'} solved{each}{missing}; {took}", simulated=True)
    forms = dict.fromkeys(texts, "{}") | dict.fromkeys(numbers, "{:.4g}") | dict.fromkeys(shares, "{:.2%}")
    trials = tables["trials" if texts else "conditions"]
    rows = [[form.format(row[name]) for name, form in forms.items()] for row in trials]
    heads = [name.replace("_", " ") for name in (*texts, *numbers, *shares.values())]
    print_grid(heads, rows, title=f"field error: mean, 95 % stay below, worst; {bits}: of rounded phases")


Numbers = Annotated[tuple[float, ...], Parameter(consume_multiple=True)]
Lengths = Annotated[tuple[float, ...], quantity("m", many=-1), Parameter(consume_multiple=True, metavar="QUANTITIES")]


def patterns_command(
    output: Folder,
    /,
    *,
    strength: Numbers = (0.1, 0.2),
    height: Lengths = (HEIGHT,),
    count: int = 65535,
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
    Results are stored as they are computed; run the same command again to resume.

    Parameters
    ----------
    strength
        Target peak relative to a single focus of the whole array.
    height
        Height of the control points above the array.
    count
        Number of patterns, drawn with the seed; 65535 is all.
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
    chunk
        Patterns per task; a killed process loses at most one task.

    Examples
    --------
    $ midair sweep patterns patterns.sweep --count 1000 --strength 0.1
    """
    medium = (air or AirOptions()).medium() or Medium(attenuation=0.0)
    if attenuation is not None:
        medium = replace(medium, attenuation=attenuation)
    sweep = PatternSweep(
        strengths=strength,
        heights=height,
        count=count,
        seed=seed,
        method=method,
        iterations=iterations,
        acoustics=Acoustics(medium=medium, directivity=directivity),
        bits=bits,
        chunk=chunk,
    )
    return solve_and_show(sweep, output, scheduler=scheduler, workers=workers)


def recordings_command(
    output: Folder,
    /,
    *sources: Path,
    vary: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
    options: SolveOptions | None = None,
    start_at: Time = 0.0,
    duration: OptionalTime = None,
    bits: Bits = 8,
    scheduler: Scheduler = None,
    workers: Workers = None,
) -> int:
    """Solve recordings with many settings, or resume an interrupted sweep.

    Every recording is solved with every combination of the varied options, and E of every frame is stored.
    Run the same command again to resume.

    Parameters
    ----------
    sources
        Recordings with a calibration.
    vary
        Options of midair solve to vary, as OPTION=VALUE,VALUE, or any setting by its name in a settings file.
        Example: method=fast,glide height=150mm,200mm solver.fit=cells,windows band="20Hz 470Hz,20Hz 200Hz"
    start_at
        Start of the part to use in each recording.
    duration
        Length of the part to use in each recording. [default: to the end]

    Examples
    --------
    $ midair sweep recordings heights.sweep take.h5 --vary height=150mm,200mm --duration 0.1s
    """
    if not sources:
        raise InputError("sweep: expected recordings after the name of the sweep, got none")
    options = options or SolveOptions()
    # Every combination: its name, and its options.
    axes = [_axis(text) for text in vary]
    names = [text.partition("=")[0].strip() for text in vary]
    if len(set(names)) < len(names):
        raise InputError(f"--vary: expected each option once, got {' '.join(vary)}")
    variants = [
        (" ".join(spelt for spelt, _ in chosen), _with(options, [choice for _, choice in chosen]))
        for chosen in itertools.product(*axes)
    ]
    for _, chosen in variants:
        chosen.refuse_idle_palm()
    if not any(text.startswith("temperature=") for text in vary):
        print_air(options.settings().acoustics.medium, stated=options.air_is_stated)
    trials = [_trial(source, name, chosen, start_at, duration) for name, chosen in variants for source in sources]
    sweep = RecordingSweep(trials=tuple(trials), bits=bits)
    return solve_and_show(sweep, output, scheduler=scheduler, workers=workers)


def _with(options: SolveOptions, choices: Sequence[tuple[str, Any]]) -> SolveOptions:
    lines = tuple(line for field, line in choices if field == "set")
    return replace(options, **dict(choices) | {"set": (*options.set, *lines)})


def _trial(source: Path, variant: str, options: SolveOptions, start: float, duration: float | None) -> SweepTrial:
    settings = options.settings()
    take = open_take(source)
    pressure = calibrated_pressure(take.recording, take.calibration, settings)
    part = pressure if start == 0 and duration is None else pressure.cut(start, duration)
    known = with_fitted_gain(part, TransducerArray.autd3(), settings)
    return SweepTrial(recording=source.name, variant=variant, pressure=part, settings=known)


def _axis(text: str) -> list[tuple[str, tuple[str, Any]]]:
    """The values of OPTION=VALUE,VALUE: as written, and as `midair solve` parses them."""
    name, equals, values = text.partition("=")
    if not equals or not all(value.strip() for value in values.split(",")):
        raise InputError(f"--vary: expected OPTION=VALUE,VALUE such as height=150mm,200mm, got {text!r}")
    if "." in name:
        return [(f"{name}={value}", ("set", f"{name.strip()}={value.strip()}")) for value in values.split(",")]
    field = name.strip().replace("-", "_")
    return [
        (f"{name}={value.strip()}", (field, _read(name.strip(), field, value.split()))) for value in values.split(",")
    ]


def _read(name: str, field: str, tokens: Sequence[str]) -> Any:
    reader = App(result_action="return_value")

    @reader.default
    def read(*, options: SolveOptions | None = None) -> SolveOptions:  # pyright: ignore[reportUnusedFunction]
        return options or SolveOptions()

    try:
        found = reader([f"--{name}", *tokens], exit_on_error=False, print_error=False)
        return getattr(found, field)
    except CycloptsError as wrong:
        raise InputError(f"--vary {name}: {' '.join(str(wrong).split())}") from None


def report_command(source: Path, /, *, output: Path | None = None, json: Json = False) -> None:
    """Write tables (CSV) and figures (PNG) of a sweep, finished or not.

    Patterns: histogram of E, E by active channels, over strength and over height. Recordings: E of each trial.

    Parameters
    ----------
    source
        Folder of the sweep.
    output
        Output folder. [default: NAME.report]

    Examples
    --------
    $ midair sweep report patterns.sweep
    """
    results = load_sweep(source)
    files = [str(file) for file in write_sweep_report(results, output or source.with_suffix(".report"))]
    if json:
        return print_json({"simulated": True} | sweep_report(results) | {"files": files})
    show_report(results)
    out().print("\n".join(files))
    return None


sweep_app = App(
    name="sweep", help_epilogue=epilogue(("midair sweep patterns patterns.sweep --count 1000 --strength 0.1",))
)
add_command(sweep_app, patterns_command, "patterns")
add_command(sweep_app, recordings_command, "recordings")
add_command(sweep_app, report_command, "report")
