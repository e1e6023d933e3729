"""The commands `study analyse` and `study export`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from midair import files
from midair.cli.console import out, print_json, print_note, warn_simulated
from midair.cli.options import Json, Study
from midair.errors import InputError
from midair.study import (
    ExportFormat,
    Program,
    StudyFolder,
    analyse,
    answers_table,
    columns_of,
    data_of_columns,
    export,
    read_bids,
    read_csv,
    report_page,
    simulation_of,
    unfinished_sessions,
    write_report,
)
from midair.table import describe, plain, printed


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
    where: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
    program: Annotated[Program | None, Parameter(name="--from")] = None,
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
    margin
        Largest difference of macro F between conditions that does not matter.
    where
        COLUMN=VALUE: analyse only the rows of a table with this value; COLUMN= for rows without a value.
    program
        The table is of this program, whose usual columns are used where no other is named.

    Examples
    --------
    $ midair study analyse touch
    $ midair study analyse psychopy.csv --from psychopy
    """
    selected = [(name, value) for name, equals, value in (one.partition("=") for one in where) if equals]
    if len(selected) < len(where):
        raise InputError(f"--where: expected COLUMN=VALUE, got {' '.join(where)}")
    if (source / "plan.json").exists():
        if where or program:
            raise InputError(
                f"{'--where' if where else '--from'}: expected a table, got a study, whose plan selects answers"
            )
        target = output or source / "report.html"
        report = write_report(StudyFolder(source), target, seed=seed, draws=draws)
    else:
        table = read_bids(source) if source.is_dir() else read_csv(source)
        named = {"participant": participant, "presented": presented, "answered": answered, "rating": rating}
        named = named if program is None else columns_of(table, program, named)
        selected += [(loop, "")] if (loop := named.pop("practice", "")) else []
        data = data_of_columns(
            table,
            **(named if within else named | {"rating": ""}) if program else named,
            condition=condition,
            within=within,
            margin=margin,
            where=selected,
            simulated=simulation_of(table),
        )
        report, target = analyse(data, seed=seed, draws=draws), output or source.with_name(f"{source.stem}-report.html")
        files.write_file(target, report_page(report, title=source.name, within=data.within), private=True)
    table = describe(report)
    if json:
        return print_json(plain(table) | {"simulated": bool(report.simulated)})
    out().print("\n\n".join(f"{title}\n{words}" for title, words in printed(table)))
    out().print(f"\nreport {target}")
    return warn_simulated(report.simulated)


def export_command(study: Study, output: Path, /, *, format: ExportFormat = "bids") -> None:
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
    written = export(folder, output, format)
    sessions = folder.sessions()
    answers = answers_table(folder.plan(), sessions)
    told = f"{len(written)} files" if format == "bids" else f"its analysis in R is {written[1].name}"
    out().print(f"{output}: {told}, {len(answers)} answers.")
    for who, state in unfinished_sessions(sessions).items():
        print_note(f"{who}: {state}", warn=True)
    warn_simulated(simulation_of(answers))
