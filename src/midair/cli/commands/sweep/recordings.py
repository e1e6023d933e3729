"""The command `sweep recordings`: solve recordings with many settings in parallel."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from midair.cli.commands.sweep.output import Bits, Scheduler, Store, Workers, run_with_bar, show_trials
from midair.cli.console import out
from midair.cli.exposure_options import print_air
from midair.cli.options import OptionalTime, SolveOptions, Time
from midair.errors import InputError
from midair.files import open_take
from midair.model import TransducerArray
from midair.pipeline import calibrated_pressure, with_fitted_gain
from midair.sweep import RecordingSweep, SweepTrial, load_sweep, trial_report

Choice = tuple[str, Any]


def recordings_command(
    output: Store,
    /,
    *sources: Path,
    vary: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
    options: SolveOptions | None = None,
    start_at: Time = 0.0,
    duration: OptionalTime = None,
    bits: Bits = 8,
    blocks: int = 4,
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
        Options of midair solve to vary, as OPTION=VALUE,VALUE.
        Example: method=fast,glide height=150mm,200mm band="20Hz 470Hz,20Hz 200Hz"
    start_at
        Start of the part to use in each recording.
    duration
        Length of the part to use in each recording. [default: to the end]
    blocks
        Blocks of method glide per task; a long recording is divided among processes with an identical result.

    Examples
    --------
    $ midair sweep recordings sweep.zarr take.h5 --vary height=150mm,200mm --duration 0.1s
    """
    if not sources:
        raise InputError("sweep: expected recordings after the name of the sweep, got none")
    options = options or SolveOptions()
    variants = _variants(options, vary)
    for _, chosen in variants:
        chosen.refuse_idle_palm()
    if not any(text.startswith("temperature=") for text in vary):
        print_air(options.settings().acoustics.medium, stated=options.air_is_stated)
    trials = [_trial(source, name, chosen, start_at, duration) for name, chosen in variants for source in sources]
    status = run_with_bar(
        RecordingSweep(trials=tuple(trials), bits=bits, blocks=blocks), output, scheduler=scheduler, workers=workers
    )
    if status == 0:
        show_trials(trial_report(load_sweep(output)))
        out().print(f"Next: midair sweep report {output}")
    return status


def _trial(source: Path, variant: str, options: SolveOptions, start: float, duration: float | None) -> SweepTrial:
    settings = options.settings()
    # Lazy frames as in midair solve; their filters agree with those of an array to a few parts in a million.
    take = open_take(source, streamed=settings.solver.name == "glide")
    pressure = calibrated_pressure(take.recording, take.calibration, settings)
    part = pressure if start == 0 and duration is None else pressure.cut(start, duration)
    known = with_fitted_gain(part, TransducerArray.autd3(), settings)
    return SweepTrial(recording=source.name, variant=variant, pressure=part, settings=known)


def _variants(options: SolveOptions, vary: Sequence[str]) -> list[tuple[str, SolveOptions]]:
    """Every combination: its name, and its options."""
    axes = [_axis(text) for text in vary]
    names = [name for axis in axes for name in {field for _, (field, _) in axis}]
    if len(set(names)) < len(names):
        raise InputError(f"--vary: expected each option once, got {' '.join(vary)}")
    return [
        (" ".join(spelt for spelt, _ in chosen), _with(options, dict(choice for _, choice in chosen)))
        for chosen in itertools.product(*axes)
    ]


def _with(options: Any, changes: dict[str, Any]) -> SolveOptions:
    return replace(options, **changes)


def _axis(text: str) -> list[tuple[str, Choice]]:
    """The values of OPTION=VALUE,VALUE: as written, and as `midair solve` parses them."""
    name, equals, values = text.partition("=")
    if not equals or not all(value.strip() for value in values.split(",")):
        raise InputError(f"--vary: expected OPTION=VALUE,VALUE such as height=150mm,200mm, got {text!r}")
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
