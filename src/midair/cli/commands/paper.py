"""The command `paper`: reproduce figures and numbers of the paper in two modes."""

from pathlib import Path
from typing import Annotated, Literal, cast

from cyclopts import Parameter

from midair.cli.console import print_answer, print_grid, print_json, print_rows, progress_bars
from midair.cli.exposure_options import AirOptions, print_air
from midair.cli.options import Force, Json, Seed, Time
from midair.cli.output import may_write
from midair.model import Acoustics
from midair.paper import FidelityPlan, PaperResult, fidelity_table, figure_3, figure_4, figure_9
from midair.progress import report_to
from midair.rig import VirtualRig
from midair.settings import Mode, paper_mode

Number = Literal[3, 4, 9]


def paper_command(
    folder: Path = Path("paper"),
    /,
    *,
    figure: Annotated[tuple[Number, ...], Parameter(consume_multiple=True)] = (),
    fidelity: bool = False,
    mode: Mode = "best",
    things: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = FidelityPlan().things,
    strength: float = 0.15,
    duration: Time = 0.12,
    iterate: int = 6,
    air: AirOptions | None = None,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> None:
    """Reproduce the paper's figures and numbers on a virtual rig, in the paper's mode and in the best mode.

    Each result is written as PNG, CSV and JSON, and marked as simulated.
    Figures 3 and 9 take seconds; figure 4 and --fidelity take minutes, since they solve 4000 frames a second.
    docs/paper.md compares the numbers with the printed ones.

    Parameters
    ----------
    folder
        Output folder.
    figure
        3: patterns and fields. 4: stimuli i to iii, original and re-recorded. 9: spectra of the objects.
        [default: all three and --fidelity, unless --fidelity is given]
    fidelity
        Compute error budgets of test signals and objects in both modes at one strength, with iterative correction.
    mode
        Mode to compare with the paper's: best, quick or finest; paper for no comparison.
    things
        Signals for --fidelity: 25+250 Hz, noise, bursts, brush, sponge, towel, and files of calibrated recordings.
    strength
        Target peak relative to a single focus of the whole array, for figure 3 and --fidelity.
    duration
        Duration of each signal in figure 4 (a multiple of 40 ms, 80 ms or more) and in --fidelity.
    iterate
        Maximum number of iterative corrections in --fidelity; figure 4 makes at most one in the best mode.

    Examples
    --------
    $ midair paper --figure 9
    $ midair paper --fidelity --things noise
    """
    numbers = set(figure) if figure or fidelity else {3, 4, 9}
    fidelity = fidelity or not figure
    rig, medium = VirtualRig(seed=seed), (air or AirOptions()).medium()
    paper = paper_mode() if medium is None else paper_mode().but(acoustics=Acoustics(medium=medium))
    plan = FidelityPlan(
        things=things, strength=strength, duration=duration, passes=iterate, rig=rig, mode=mode, paper=paper
    )
    if fidelity or 4 in numbers:
        print_air(paper.acoustics.medium, stated=medium is not None)
    for name in [f"figure{number}" for number in sorted(numbers)] + ["fidelity"] * fidelity:
        if folder.is_dir():
            may_write(folder / f"{name}.json", force)
    results: list[PaperResult] = []
    with progress_bars() as stage:
        if 4 in numbers:  # first, since it refuses durations without whole periods
            once = min(iterate, 1)
            results.append(figure_4(paper=paper, mode=mode, duration=duration, iterate=once, rig=rig, stage=stage))
        for number in sorted(numbers - {4}):
            with report_to(stage(f"figure {number}")):
                results.append(figure_3(strength=strength, mode=mode) if number == 3 else figure_9(mode=mode))
        if fidelity:
            results.append(fidelity_table(plan, stage=stage))
    for result in results:
        written = result.write(folder)
        if not json:
            _print(result, written)
    if json:
        print_json({result.name: result.plain() for result in results})


def _print(result: PaperResult, written: list[Path]) -> None:
    names = list(result.rows[0])
    lines = [names, *([_word(row[name]) for name in names] for row in result.rows)]
    # Many columns do not fit into a terminal: they become rows.
    heads, *rows = [list(line) for line in zip(*lines, strict=True)] if len(names) > len(lines) else lines
    print_answer(result.title, simulated=True)
    print_grid(heads, rows)
    about = [(name.replace("_", " "), _word(value)) for name, value in result.about.items()]
    print_rows([*about, ("files", ", ".join(str(path) for path in written))])


def _word(value: object) -> str:
    """A value as text; long lists are shortened to their ends."""
    if isinstance(value, list):
        each = [_word(one) for one in cast("list[object]", value)]
        return ", ".join(each) if len(each) <= 6 else f"{len(each)}: {each[0]} ... {each[-1]}"
    return "-" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)
