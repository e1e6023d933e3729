"""Commands for studies on people: new, run, analyse, export, power."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from midair.cli.terminal import AirOptions, ExposureOptions, Json, PlainConsole, err, say, say_how_long
from midair.errors import InputError
from midair.files import read_text, whole_file
from midair.study import (
    ArrayPresenter,
    NoPresenter,
    Plan,
    Policy,
    Report,
    Session,
    SimulatedParticipant,
    SimulatedScreen,
    StudyData,
    StudyFolder,
    TerminalScreen,
    analyse,
    answers_table,
    block_order,
    data_of_answers,
    data_of_columns,
    paper_design_text,
    presenter_named,
    read_bids,
    read_csv,
    read_design,
    report_json,
    report_page,
    report_text,
    run,
    stops_on_signals,
    thresholds_of,
    write_bids,
    write_csv,
)

if TYPE_CHECKING:
    from pandas import DataFrame


def new_command(
    name: str,
    /,
    *,
    source: Path | None = None,
    participants: int | None = None,
    seed: int | None = None,
) -> None:
    """Draw the plan of a new study into the folder NAME.

    Parameters
    ----------
    name
        Of the folder; its last part, letters and digits only, is the name of the study.
    source
        TOML that describes the study; the paper's experiment (section 5.3) if not given.
    participants
        For how many people trials are drawn; what the TOML says if not given.
    seed
        Of all shuffles; what the TOML says if not given.

    Examples
    --------
    $ midair study new touch --participants 3
    """
    if participants is not None and participants < 1:
        raise InputError(f"--participants: expected 1 or more, got {participants}")
    text = paper_design_text() if source is None else read_text(source, "the TOML of a study")
    path = Path(name)
    kept = "".join(letter for letter in path.name if letter.isascii() and letter.isalnum())
    if not kept:
        raise InputError(f"NAME: expected letters or digits in the last part of it, got {name!r}")
    design = read_design(text, name=kept, participants=participants or 0, seed=seed)
    plan = StudyFolder.create(path, text, design).plan()
    say(f"{path}: {len(plan.of(1))} trials for each of {design.participants} participants, plan {plan.digest}.")
    for number in range(1, design.participants + 1):
        order = dict.fromkeys(block.group for block in block_order(design, number))
        say(f"  participant {number}: {', '.join(order)}")
    say(f"Next: midair study run {path} --participant 1, or try it with --simulate.")


def run_command(
    study: Path,
    /,
    *,
    participant: int = 0,
    policy: Policy = "resume",
    simulate: bool = False,
    d_prime: float = 1.2,
    array: str = "none",
    exposure: ExposureOptions | None = None,
    air: AirOptions | None = None,
) -> int:
    """Run one participant in this terminal, or go on with one who was interrupted. Ctrl-C stops at once.

    Parameters
    ----------
    study
        Folder of the study.
    participant
        Number, from 1 on; everybody who is not done if not given with --simulate.
    policy
        How an interrupted session goes on: with the unfinished trial, from the start, or from the start of the block.
    simulate
        A simulated participant answers; everything made from it is marked SIMULATED.
    d_prime
        Sensitivity of the simulated participant to reproduced objects.
    array
        What plays drives, as in midair play --device: virtual, autd3, pyautd3 and so on; "none" does for a plan of real
        objects only. What the experimenter is to take up goes to the error stream: send it to another screen than the
        participant's.
    exposure
        What a drive may expose people to.
    air
        Of the room; it is stored with the answers.

    Examples
    --------
    $ midair study run touch --participant 1 --simulate
    """
    folder = StudyFolder(study)
    plan = folder.plan()
    if simulate:
        return _run_simulated(folder, plan, participant, policy, d_prime)
    if participant < 1:
        raise InputError("participant: expected --participant N, from 1 on; or --simulate for simulated ones")
    room, choices = (air or AirOptions()).medium(), (exposure or ExposureOptions()).choices()
    screen = TerminalScreen(PlainConsole(markup=True, soft_wrap=False))
    with (
        stops_on_signals(),
        presenter_named(
            array, folder, plan, exposure=choices, room=room, before=lambda drive: say_how_long(drive, choices.profile)
        ) as presenter,
    ):
        simulated = isinstance(presenter, ArrayPresenter) and presenter.array.simulated
        log = folder.log(participant)
        try:
            with Session(plan, participant, log, presenter, policy=policy, simulated=simulated, room=room) as session:
                step = run(session, screen)
        except EOFError as closed:
            raise InputError(
                "terminal: expected answers, got the end of input; the answers so far are stored"
            ) from closed
    say("Done." if step.kind == "done" else "Stopped; the answers so far are stored.")
    return 0 if step.kind == "done" else 1


def analyse_command(
    source: Path,
    /,
    *,
    output: Path | None = None,
    seed: int = 0,
    draws: int = 10_000,
    json: Json = False,
    participant: str = "participant",
    presented: str = "",
    answered: str = "",
    condition: str = "",
    rating: str = "",
    within: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
    margin: float = 0.1,
) -> None:
    """Analyse a study, a CSV table, or a BIDS dataset; write an HTML report with a plain word beside each number.

    Parameters
    ----------
    source
        Folder of a study; or a CSV or TSV file, or a BIDS folder, with the columns named below.
    output
        The HTML file; report.html in the folder of the study, or beside the table, if not given.
    seed
        Of permutations and bootstrap.
    draws
        Number of permutations.
    participant
        Column of who answered.
    presented
        Column of the object that was presented.
    answered
        Column of the object that was answered.
    condition
        Column of a condition that divides the trials.
    rating
        Column of ratings.
    within
        Columns of the factors of the ratings.
    margin
        Difference of macro F between conditions that does not matter.

    Examples
    --------
    $ midair study analyse touch
    """
    if (source / "plan.json").exists():
        folder = StudyFolder(source)
        plan = folder.plan()
        sessions = folder.sessions()
        thresholds = thresholds_of(plan, sessions)
        data = data_of_answers(answers_table(plan, sessions), plan.design.analysis, thresholds=thresholds)
        title, target = plan.design.title or plan.design.name, output or source / "report.html"
    else:
        table = _old_table(source)
        data = data_of_columns(
            table,
            participant=participant,
            presented=presented,
            answered=answered,
            condition=condition,
            rating=rating,
            within=within,
            margin=margin,
            simulated="simulated" in table and bool((table["simulated"].astype(str) == "True").any()),
        )
        title, target = source.name, output or source.with_name(f"{source.stem}-report.html")
    report = analyse(data, seed=seed, draws=draws)
    page = report_page(report, title=title, within=data.within)
    with whole_file(target) as partial:
        partial.write_text(page, encoding="utf-8")
    _print_report(report, data, target, json=json)


def export_command(study: Path, output: Path, /, *, format: Literal["bids", "csv"] = "bids") -> None:
    """Write the answers of a study as a BIDS dataset or as one CSV table.

    Parameters
    ----------
    study
        Folder of the study.
    output
        New folder, or new CSV file.
    format
        Of the output.

    Examples
    --------
    $ midair study export touch bids
    """
    folder = StudyFolder(study)
    plan = folder.plan()
    answers = answers_table(plan, folder.sessions())
    if format == "bids":
        written = write_bids(answers, plan.design, output)
        say(f"{output}: {len(written)} files, {len(answers)} answers.")
    else:
        if answers.empty:
            raise InputError("export: expected answers, got none; run a participant first")
        write_csv(answers, output)
        say(f"{output}: {len(answers)} answers.")
    _warn_simulated(bool(answers["simulated"].any()))


def _run_simulated(folder: StudyFolder, plan: Plan, participant: int, policy: Policy, d_prime: float) -> int:
    numbers = [participant] if participant else range(1, plan.design.participants + 1)
    model = SimulatedParticipant(d_prime=d_prime, seed=plan.design.seed)
    for number in numbers:
        presenter, log = NoPresenter(), folder.log(number)
        screen = SimulatedScreen(plan=plan, participant=model, presenter=presenter)
        with Session(plan, number, log, presenter, policy=policy, simulated=True) as session:
            run(session, screen)
        say(f"participant {number}: done")
    _warn_simulated(True)
    return 0


def _old_table(source: Path) -> "DataFrame":
    return read_bids(source) if source.is_dir() else read_csv(source)


def _print_report(report: Report, data: StudyData, target: Path, *, json: bool) -> None:
    if json:
        print(report_json(report))  # noqa: T201  # a program reads it: nothing is spelled out
        return
    say(report_text(report))
    say(f"\n{target}")
    _warn_simulated(data.simulated)


def _warn_simulated(simulated: bool) -> None:
    if simulated:
        err().print("SIMULATED: no person was asked", style="bold red")
