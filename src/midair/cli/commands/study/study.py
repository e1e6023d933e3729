"""Commands for what came out of a study: analyse, export, verify."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from midair.cli.terminal import Json, say, warn_simulated
from midair.errors import InputError
from midair.files import whole_file
from midair.study import (
    Incomplete,
    Report,
    StudyData,
    StudyFolder,
    UnpresentedAnswers,
    analyse,
    analysis_notebook,
    answers_table,
    data_of_columns,
    data_of_study,
    load_study,
    load_table,
    log_derived_file,
    noted_seals,
    read_bids,
    read_csv,
    report_json,
    report_page,
    report_text,
    verify_study,
    write_bids,
    write_csv,
)

if TYPE_CHECKING:
    from pandas import DataFrame


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
    between: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
    incomplete: Incomplete = "leave out",
    foils: UnpresentedAnswers = "wrong",
    margin: float = 0.1,
) -> None:
    """Analyse a study, a CSV table, or a BIDS dataset; write an HTML report with a plain word beside each number.

    Parameters
    ----------
    source
        Folder of a study; or a CSV or TSV file, or a BIDS folder, with the columns named below.
    output
        The HTML file, beside which the analysis comes as a notebook; report.html in the folder of the study, or beside
        the table, if not given.
    seed
        Of permutations and of drawn data.
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
    between
        Columns of factors by which people differ, such as the dominant hand.
    incomplete
        People without a rating in every cell: "leave out" them, or "refuse" the analysis of variance.
    foils
        Answers that name what was never presented: "wrong", "leave out", or "refuse" the analysis of choices.
    margin
        Difference of macro F between conditions that does not matter.

    Examples
    --------
    $ midair study analyse touch
    """
    if (source / "plan.json").exists():
        folder = StudyFolder(source)
        plan, data = folder.plan(), data_of_study(folder)
        title, target = plan.design.title or plan.design.name, output or source / "report.html"
        loading = load_study(_from(target, source))
    else:
        table = _old_table(source)
        columns: dict[str, Any] = {
            "participant": participant,
            "presented": presented,
            "answered": answered,
            "condition": condition,
            "rating": rating,
            "within": within,
            "between": between,
            "incomplete": incomplete,
            "foils": foils,
            "margin": margin,
            "simulated": "simulated" in table and bool((table["simulated"].astype(str) == "True").any()),
        }
        data = data_of_columns(table, **columns)
        title, target = source.name, output or source.with_name(f"{source.stem}-report.html")
        loading = load_table(_from(target, source), columns, bids=source.is_dir())
    report = analyse(data, seed=seed, draws=draws)
    if (source / "plan.json").exists():
        for file in (target, target.with_suffix(".ipynb")):
            log_derived_file(StudyFolder(source), file, "report")
    page = report_page(report, title=title, within=data.within)
    notebook = analysis_notebook(data, loading, title=title, seed=seed, draws=draws)
    for file, text in ((target, page), (target.with_suffix(".ipynb"), notebook)):
        with whole_file(file) as partial:
            partial.chmod(0o600)
            partial.write_text(text, encoding="utf-8")
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
    verified = verify_study(folder)
    if format == "bids":
        # Before it is there: killed in between, it is known all the same to whoever withdraws.
        log_derived_file(folder, output, "bids")
        written = write_bids(
            answers, plan.design, output, files=verified.summary, unfinished=tuple(verified.unfinished)
        )
        say(f"{output}: {len(written)} files, {len(answers)} answers.")
    else:
        if answers.empty:
            raise InputError("export: expected answers, got none; run a participant first")
        log_derived_file(folder, output, "csv")
        write_csv(answers, output)
        say(f"{output}: {len(answers)} answers.")
    say(" ".join(part for part in (verified.summary, verified.unfinished_words) if part))
    warn_simulated(bool(answers["simulated"].any()))


def verify_command(study: Path, /, *, seal: Path | None = None) -> int:
    """Check the files of a study: plan, drives, and the chain and the seal of each session's log.

    Prints one line for each session and a summary. The status is 1 if something was changed, is missing, or belongs to
    another study; a session that is not finished is no fault, unless its noted seal is gone.

    Parameters
    ----------
    study
        Folder of the study.
    seal
        Text with the seals that were noted, in lines as `midair study run` and this command print them. Keep it where
        the folder of the study cannot be written from.

    Examples
    --------
    $ midair study verify touch
    """
    verified = verify_study(StudyFolder(study), noted=None if seal is None else noted_seals(seal))
    for line in (*verified.sessions, verified.summary):
        say(line)
    return 1 if verified.faults else 0


def _from(target: Path, source: Path) -> str:
    """Where a source is, seen from the folder of the report."""
    return os.path.relpath(source, target.parent)


def _old_table(source: Path) -> "DataFrame":
    return read_bids(source) if source.is_dir() else read_csv(source)


def _print_report(report: Report, data: StudyData, target: Path, *, json: bool) -> None:
    if json:
        print(report_json(report))  # noqa: T201  # a program reads it: nothing is spelled out
        return
    say(report_text(report))
    say(f"\n{target}, and the analysis as a notebook: {target.with_suffix('.ipynb')}")
    warn_simulated(data.simulated)
