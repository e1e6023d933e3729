"""The command `paper`: reproduce figures and numbers of the paper in two modes."""

from pathlib import Path
from typing import Annotated, Literal, cast

from cyclopts import Parameter

from midair.cli.console import print_answer, print_grid, print_json, print_rows, progress_bars
from midair.cli.exposure_options import AirOptions, print_air
from midair.cli.options import Force, Json, Seed, Time
from midair.cli.output import may_write
from midair.model import Acoustics
from midair.paper import FidelityPlan, PaperResult, StimuliPlan, fidelity_table, figure_3, figure_4, figure_9
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
    everything = not figure and not fidelity
    chosen = {3, 4, 9} if everything else set(figure)
    rig, medium = VirtualRig(seed=seed), (air or AirOptions()).medium()
    paper = paper_mode() if medium is None else paper_mode().but(acoustics=Acoustics(medium=medium))
    if everything or fidelity or 4 in chosen:
        print_air(paper.acoustics.medium, stated=medium is not None)
    results: list[PaperResult] = []
    stimuli = None
    if 4 in chosen:
        # First, since it refuses durations without whole periods.
        stimuli = StimuliPlan(duration=duration, iterate=min(iterate, 1), rig=rig, mode=mode, paper=paper)
    with progress_bars() as stage:
        if 3 in chosen:
            _check(folder, "figure3", force)
            with report_to(stage("figure 3")):
                results.append(figure_3(strength=strength, mode=mode))
        if 9 in chosen:
            _check(folder, "figure9", force)
            with report_to(stage("figure 9")):
                results.append(figure_9(mode=mode))
        if stimuli is not None:
            _check(folder, "figure4", force)
            results.append(figure_4(stimuli, stage=stage))
        if fidelity or everything:
            _check(folder, "fidelity", force)
            plan = FidelityPlan(
                things=things, strength=strength, duration=duration, passes=iterate, rig=rig, mode=mode, paper=paper
            )
            results.append(fidelity_table(plan, stage=stage))
    for result in results:
        written = result.write(folder)
        if not json:
            _print(result, written)
    if json:
        print_json({result.name: result.plain() for result in results})


def _check(folder: Path, name: str, force: bool) -> None:
    """Refuse existing output before the work begins."""
    if folder.is_dir():
        may_write(folder / f"{name}.json", force)


def _print(result: PaperResult, written: list[Path]) -> None:
    names = list(result.rows[0])
    lines = [names, *([_word(row[name]) for name in names] for row in result.rows)]
    # Many columns do not fit into a terminal: they become rows.
    heads, *rows = [list(line) for line in zip(*lines, strict=True)] if len(names) > len(lines) else lines
    print_answer(result.title, simulated=True)
    print_grid(heads, rows)
    about = [(name.replace("_", " "), _words(value)) for name, value in result.about.items()]
    print_rows([*about, ("files", ", ".join(str(path) for path in written))])


def _words(value: object) -> str:
    """A value of the description; long lists are shortened to their ends."""
    if not isinstance(value, list):
        return _word(value)
    each = [_word(one) for one in cast("list[object]", value)]
    return ", ".join(each) if len(each) <= 6 else f"{len(each)}: {each[0]} ... {each[-1]}"


def _word(value: object) -> str:
    return "-" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)
