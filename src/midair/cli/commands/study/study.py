"""The commands `study analyse` and `study export`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from midair import files
from midair.cli.console import out, print_note, warn_simulated
from midair.cli.options import Json, Study
from midair.errors import FileError, InputError
from midair.study import (
    Incomplete,
    StudyFolder,
    UnpresentedAnswers,
    analyse,
    answers_table,
    data_of_columns,
    data_of_study,
    log_derived_file,
    markers_table,
    read_bids,
    read_csv,
    report_json,
    report_page,
    report_text,
    script_of_plan,
    simulation_of,
    unfinished_sessions,
    write_bids,
    write_csv,
)


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
    incomplete: Incomplete = "leave out",
    foils: UnpresentedAnswers = "wrong",
    margin: float = 0.1,
    where: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
) -> None:
    """Analyse a study, a CSV table or a BIDS dataset, and write an HTML report that explains each number.

    Parameters
    ----------
    source
        Folder of a study; or a CSV or TSV file, or a BIDS folder, with the columns given below.
    output
        HTML file to write.
        [default: report.html in the study folder, or beside the table]
    seed
        Random seed of permutations and simulated data.
    draws
        Number of permutations.
    participant
        Column of the participant.
    presented
        Column of the presented object.
    answered
        Column of the answered object.
    condition
        Column of a condition that divides the trials.
    rating
        Column of the ratings.
    within
        Columns of the within-subject factors of the ratings.
    incomplete
        How to treat participants without a rating in every cell.
        leave out: ignore them. refuse: skip the analysis of variance.
    foils
        How to treat answers that name an object that was never presented.
        wrong: count them as wrong. leave out: ignore them. refuse: skip the analysis of choices.
    margin
        Largest difference of macro F between conditions that does not matter.
    where
        COLUMN=VALUE: analyse only the rows of a table with this value; COLUMN= for rows without a value.

    Examples
    --------
    $ midair study analyse touch
    """
    selected = [(name, value) for name, equals, value in (one.partition("=") for one in where) if equals]
    if len(selected) < len(where):
        raise InputError(f"--where: expected COLUMN=VALUE, got {' '.join(where)}")
    if (source / "plan.json").exists():
        if where:
            raise InputError(
                "--where: expected a table, got a study, whose plan selects answers (analysis, exclusions)"
            )
        folder = StudyFolder(source)
        plan, data = folder.plan(), data_of_study(folder)
        title, target = plan.design.title or plan.design.name, output or source / "report.html"
    else:
        table = read_bids(source) if source.is_dir() else read_csv(source)
        data = data_of_columns(
            table,
            participant=participant,
            presented=presented,
            answered=answered,
            condition=condition,
            rating=rating,
            within=within,
            incomplete=incomplete,
            foils=foils,
            margin=margin,
            where=selected,
            simulated=simulation_of(table),
        )
        title, target = source.name, output or source.with_name(f"{source.stem}-report.html")
    report = analyse(data, seed=seed, draws=draws)
    if (source / "plan.json").exists():
        log_derived_file(StudyFolder(source), target, "report")
    files.write_file(target, report_page(report, title=title, within=data.within), private=True)
    if json:
        print(report_json(report))  # noqa: T201
        return
    out().print(report_text(report))
    out().print(f"\nreport {target}")
    warn_simulated(data.simulated)


def export_command(study: Study, output: Path, /, *, format: Literal["bids", "csv"] = "bids") -> None:
    """Export the answers of a study as a BIDS dataset, or as a CSV table with an R script of mixed models.

    Parameters
    ----------
    output
        New folder (bids) or new file (csv).
    format
        Output format.

    Examples
    --------
    $ midair study export touch bids
    """
    folder = StudyFolder(study)
    plan, sessions = folder.plan(), folder.sessions()
    answers = answers_table(plan, sessions)
    if answers.empty:
        raise InputError("export: expected answers, got none; run a participant first")
    script = output.with_suffix(".R")
    if format == "csv" and script.exists():
        raise FileError(
            f"{script.name}: expected a new file beside {output.name}, the file exists; choose another name"
        )
    # Logged before the export exists, so that `study withdraw` also finds an interrupted one.
    log_derived_file(folder, output, format)
    unfinished, told = unfinished_sessions(sessions), ""
    if format == "bids":
        markers = markers_table(sessions)
        written = write_bids(answers, plan.design, output, unfinished=tuple(unfinished), markers=markers)
        told = f"{len(written)} files, "
    else:
        write_csv(answers, output)
        files.write_file(script, script_of_plan(plan.design, table=output.name, script=script.name))
        told = f"its analysis in R is {script.name}, "
    out().print(f"{output}: {told}{len(answers)} answers.")
    for who, state in unfinished.items():
        print_note(f"{who}: {state}", warn=True)
    warn_simulated(simulation_of(answers))
