"""Answers as files: plain CSV, and the tables of the Brain Imaging Data Structure for behaviour (BIDS 1.10, "beh")."""

import csv
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import BrokenFileError, FileError, InputError, MissingFileError
from midair.study.design import Design
from midair.study.statistics import Table
from midair.version import __version__

MEANING: Mapping[str, str] = {
    "trial": "Number of the trial within the session, from 1 on.",
    "block": "Block of the plan.",
    "group": "Group of blocks that stay together.",
    "repetition": "How often the stimulus had come in the block, this time included.",
    "stimulus": "Name of the stimulus in the plan.",
    "scored": "Whether the trial counts; false for familiarisation.",
    "question": "Question that was asked.",
    "kind": "Kind of the question.",
    "answer": "Answer that was given.",
    "right": "Right answer; n/a where nothing is right or wrong.",
    "correct": "1 if right, 0 if wrong; n/a where nothing is right or wrong.",
    "response_time": "From the question to the answer.",
    "time": "When the answer was given, ISO 8601.",
    "simulated": "Whether the participant is simulated.",
}
"""What the columns of an answers table mean."""


def write_csv(table: Table, path: Path) -> None:
    """A table as CSV with a line of names.

    Raises
    ------
    FileError
        If the file is there already.
    """
    _write_separated(table, path, ",")


def read_csv(path: Path) -> Table:
    """A table from CSV or TSV with a line of names; a column of numbers becomes numbers.

    Raises
    ------
    MissingFileError
        If there is no such file.
    BrokenFileError
        If it is no such table.
    """
    if not path.is_file():
        raise MissingFileError(f"{path.name}: expected a table, got no such file")
    delimiter = "\t" if path.suffix == ".tsv" else ","
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file, delimiter=delimiter, strict=True))
    except (csv.Error, UnicodeDecodeError) as wrong:
        raise BrokenFileError(f"{path.name}: expected a table in UTF-8, got: {wrong}") from wrong
    rows = [row for row in rows if row]
    if len(rows) < 2 or len(set(rows[0])) < len(rows[0]):
        raise BrokenFileError(f"{path.name}: expected different names and rows of answers, got {len(rows)} lines")
    uneven = next((i for i, row in enumerate(rows, start=1) if len(row) != len(rows[0])), None)
    if uneven:
        raise BrokenFileError(
            f"{path.name}: expected {len(rows[0])} fields a line, got {len(rows[uneven - 1])} in line {uneven}"
        )
    columns = zip(*rows[1:], strict=True)
    return Table({name: _typed(values) for name, values in zip(rows[0], columns, strict=True)})


def write_bids(answers: Table, design: Design, folder: Path) -> list[Path]:
    """Answers as a BIDS dataset: ``sub-NN/beh/sub-NN_task-NAME_beh.tsv`` with a JSON sidecar for each participant.

    Parameters
    ----------
    answers : Table
        As `answers_table` makes it.
    design : Design
        For the sidecars.
    folder : Path
        New or empty.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    FileError
        If the folder holds something.
    InputError
        If there are no answers.
    """
    if not answers.height:
        raise InputError("export: expected answers, got none; run a participant first")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FileError(f"{folder.name}: expected a new folder for the dataset, got one that holds something")
    folder.mkdir(parents=True, exist_ok=True)
    people = list(dict.fromkeys(answers["participant"].tolist()))
    simulated = bool(answers["simulated"].any())
    written = [_text(folder / "README", _readme(design, simulated))]
    written.append(_json(folder / "dataset_description.json", _description(design, simulated)))
    written += _participants(answers, people, folder)
    for person in people:
        name = folder / person / "beh" / f"{person}_task-{design.name}_beh"
        name.parent.mkdir(parents=True)
        rows = answers.where({"participant": person})
        tsv = Table(
            {_bids_name(column): _bids_values(column, rows[column]) for column in rows if column != "participant"}
        )
        _write_separated(tsv, name.with_suffix(".tsv"), "\t")
        written += [name.with_suffix(".tsv"), _json(name.with_suffix(".json"), _sidecar(tsv, design))]
    return written


def read_bids(folder: Path) -> Table:
    """Every behavioural table of a BIDS dataset below each other, with the participant as a column.

    Columns that one table lacks are "n/a" there.

    Raises
    ------
    MissingFileError
        If there are none.
    """
    files = sorted(folder.glob("sub-*/**/beh/*_beh.tsv")) + sorted(folder.glob("sub-*/beh/*_beh.tsv"))
    files = list(dict.fromkeys(files))
    if not files:
        raise MissingFileError(f"{folder.name}: expected sub-*/beh/*_beh.tsv, got none; is this a BIDS dataset?")
    tables = [(file.name.split("_")[0], read_csv(file)) for file in files]
    names = list(dict.fromkeys(name for _, table in tables for name in table))
    rows: list[dict[str, Any]] = []
    for person, table in tables:
        rows += [{"participant": person} | {name: row.get(name, "n/a") for name in names} for row in table.rows]
    joined = {name: _typed([str(row[name]) for row in rows]) for name in ("participant", *names)}
    return Table({_own_name(name): _own_values(name, values) for name, values in joined.items()})


def _typed(values: Iterable[str]) -> np.ndarray:
    listed = list(values)
    if all(value in ("true", "false", "True", "False") for value in listed):
        return np.array([value.lower() == "true" for value in listed])
    try:
        return np.array([float(value) for value in listed])
    except ValueError:
        return np.array(listed)


def _write_separated(table: Table, path: Path, delimiter: str) -> None:
    if path.exists():
        raise FileError(f"{path.name}: expected a new file, got one that is there; choose another name")
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, delimiter=delimiter, lineterminator="\n")
        writer.writerow(list(table))
        writer.writerows([[_field(value) for value in row.values()] for row in table.rows])


def _field(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _bids_name(column: str) -> str:
    return {"reaction_s": "response_time"}.get(column, column)


def _own_name(column: str) -> str:
    return {"response_time": "reaction_s"}.get(column, column)


def _bids_values(column: str, values: np.ndarray) -> np.ndarray:
    return np.where(values < 0, "n/a", values.astype(str)) if column == "correct" else values


def _own_values(column: str, values: np.ndarray) -> np.ndarray:
    if column == "correct" and values.dtype.kind == "U":
        return np.array([-1 if value == "n/a" else int(float(value)) for value in values.tolist()])
    if column in ("answer", "right"):
        return np.array([f"{value:g}" if isinstance(value, float) else str(value) for value in values.tolist()])
    return values


def _description(design: Design, simulated: bool) -> dict[str, Any]:
    return {
        "Name": ("SIMULATED: " if simulated else "") + (design.title or design.name),
        "BIDSVersion": "1.10.0",
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "midair", "Version": __version__}],
    }


def _readme(design: Design, simulated: bool) -> str:
    first = "SIMULATED: no person took part. These answers come from a model.\n\n" if simulated else ""
    return (
        f"{first}{design.title or design.name}\n\nAnswers of a study of touch in midair, one row an answer. The plan"
        f" was drawn before the first participant with seed {design.seed} for {design.participants} participants.\n"
    )


def _participants(answers: Table, people: list[str], folder: Path) -> list[Path]:
    rows = Table(
        {
            "participant_id": np.array(people),
            "simulated": np.array([bool(answers.where({"participant": who})["simulated"].any()) for who in people]),
            "answers": np.array([answers.where({"participant": who}).height for who in people]),
        }
    )
    path = folder / "participants.tsv"
    _write_separated(rows, path, "\t")
    meaning = {
        "participant_id": {"Description": "Name of the participant in this dataset."},
        "simulated": {"Description": MEANING["simulated"]},
        "answers": {"Description": "Number of answers that count."},
    }
    return [path, _json(folder / "participants.json", meaning)]


def _sidecar(table: Table, design: Design) -> dict[str, Any]:
    columns: dict[str, Any] = {
        name: {"Description": MEANING.get(name, f"Level of the factor {name}; n/a where it has none.")}
        for name in table
    }
    columns["response_time"]["Units"] = "s"
    columns["question"]["Levels"] = {question.name: question.text for question in design.questions}
    told = [text for text in (design.consent, *(block.text for block in design.blocks)) if text]
    task = {"TaskName": design.name, "TaskDescription": design.title or design.name}
    return {**task, "Instructions": " ".join(told), **columns} if told else {**task, **columns}


def _json(path: Path, content: Mapping[str, Any]) -> Path:
    return _text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def _text(path: Path, content: str) -> Path:
    path.write_text(content, encoding="utf-8")
    return path
