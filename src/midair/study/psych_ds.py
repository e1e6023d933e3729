"""Answers as a dataset of Psych-DS, the standard for tables of behavioural data (https://psych-ds.github.io)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from midair.study.tables import column_meaning, readme_of, write_dataset, write_json, write_separated, write_text

if TYPE_CHECKING:
    from pathlib import Path

    from pandas import DataFrame

    from midair.study.design import Design

SCHEMA = "Psych-DS 1.5.0"
"""Version of the specification that the datasets follow."""


def write_psych_ds(answers: DataFrame, design: Design, folder: Path, *, files: str = "") -> list[Path]:
    """Write answers as a Psych-DS dataset: ``data/sub-NN/study-NAME_subject-NN_data.csv`` for each participant.

    `answers` is the result of `answers_table`; texts and factors of the design describe the columns. `files`, the
    result of the check of the study's files, goes to the README. Returns the written files. Raises FileError if the
    folder is not empty, and InputError if there are no answers.
    """
    return write_dataset(answers, folder, lambda partial: _dataset(answers, design, partial, files))


def _dataset(answers: DataFrame, design: Design, folder: Path, files: str) -> list[Path]:
    table = answers.rename(columns={"participant": "participant_id", "reaction_s": "response_time"})
    table["correct"] = table["correct"].astype(str).replace("-1", "n/a")
    simulated = bool(answers["simulated"].any())
    written = [
        write_json(folder / "dataset_description.json", _description(table, design, simulated)),
        write_text(folder / "README.md", readme_of(design, simulated, files)),
    ]
    for person, rows in table.groupby("participant_id", sort=False):
        number = str(person).removeprefix("sub-")
        path = folder / "data" / str(person) / f"study-{design.name}_subject-{number}_data.csv"
        path.parent.mkdir(parents=True)
        write_separated(rows, path, ",")
        written.append(path)
    return written


def _description(table: DataFrame, design: Design, simulated: bool) -> dict[str, Any]:
    mark = "SIMULATED: " if simulated else ""
    title = design.title or design.name
    stated = {
        "author": [{"@type": "Person", "name": name} for name in design.authors],
        "license": design.license,
        "sourceOrganization": {"@type": "Organization", "name": design.institution} if design.institution else None,
    }
    return {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": mark + title,
        "description": f"{mark}Answers of the study of touch {title!r}, one row per answer.",
        "schemaVersion": SCHEMA,
        "variableMeasured": [_variable(str(name), design) for name in table.columns],
    } | {name: value for name, value in stated.items() if value}


def _variable(name: str, design: Design) -> dict[str, str]:
    unit = {"unitText": "s"} if name in ("response_time", "time") else {}
    return {"@type": "PropertyValue", "name": name, "description": column_meaning(name, design), **unit}
