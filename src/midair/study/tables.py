"""Answers as files: plain CSV, and the tables of the Brain Imaging Data Structure for behaviour (BIDS 1.10, "beh")."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import BrokenFileError, FileError, InputError, MissingFileError
from midair.files import no_formula, whole_file, whole_folder
from midair.version import __version__

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from pathlib import Path

    from pandas import DataFrame, Series

    from midair.study.design import Design

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
    "time": "When the answer was given, from the beginning of the session.",
    "session": "Number of the session, from 1 on.",
    "role": "What the trial is for: test, catch, anchor or attention.",
    "excluded": "Rule of the plan that leaves the answer or its participant out; n/a if none does.",
    "reaction_by": "How the response time was taken: key, line (of the Enter after it), page, or model.",
    "failed_plays": "How often the presentation had failed and was made again.",
    "simulated": "Whether the participant is simulated.",
}
"""What the columns of an answers table mean."""


def write_csv(table: DataFrame, path: Path) -> None:
    """A table as CSV with a line of names, whole or not at all.

    Raises
    ------
    FileError
        If the file is there already, or cannot be written.
    """
    if path.exists():
        raise FileError(f"{path.name}: expected a new file, got one that is there; choose another name")
    with whole_file(path) as partial:
        partial.chmod(0o600)  # it holds what people answered
        _write_separated(table, partial, ",")


def read_csv(path: Path) -> DataFrame:
    """A table from CSV or TSV with a line of names; a column of numbers becomes numbers.

    Raises
    ------
    MissingFileError
        If there is no such file.
    BrokenFileError
        If it is no such table.
    """
    return _typed(_words(path))


def write_bids(
    answers: DataFrame, design: Design, folder: Path, *, files: str = "", unfinished: Collection[str] | None = None
) -> list[Path]:
    """Answers as a BIDS dataset: ``sub-NN/beh/sub-NN_task-NAME_beh.tsv`` with a JSON sidecar for each participant.

    With several sessions each has a folder of its own, ``sub-NN/ses-MM/beh/sub-NN_ses-MM_task-NAME_beh.tsv``.

    Parameters
    ----------
    answers : DataFrame
        As `answers_table` makes it.
    design : Design
        For the sidecars.
    folder : Path
        New or empty.
    files : str
        Result of the check of the study's files, for the README and the description of the dataset.
    unfinished : collection of str
        Participants whose sessions are not finished, for a column of the participants; without it if not given.

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
    if answers.empty:
        raise InputError("export: expected answers, got none; run a participant first")
    with whole_folder(folder) as partial:
        written = _dataset(answers, design, partial, files, unfinished)
        for inside in (partial, *partial.rglob("*")):  # it holds what people answered
            inside.chmod(0o700 if inside.is_dir() else 0o600)
        return [folder / path.relative_to(partial) for path in written]


def _dataset(
    answers: DataFrame, design: Design, folder: Path, files: str, unfinished: Collection[str] | None
) -> list[Path]:
    simulated = bool(answers["simulated"].any())
    written = [_text(folder / "README", _readme(design, simulated, files))]
    written.append(_json(folder / "dataset_description.json", _description(design, simulated, files)))
    written += _participants(answers, design, folder, unfinished)
    in_folders = design.sessions > 1
    of_session = answers["session"].map("ses-{:02d}".format) if in_folders else answers["participant"]
    for person, session in dict.fromkeys(zip(answers["participant"], of_session, strict=True)):
        rows = answers.loc[(answers["participant"] == person) & (of_session == session)]
        parts = [str(person), *([str(session)] if in_folders else [])]
        name = folder.joinpath(*parts, "beh", "_".join([*parts, f"task-{design.name}", "beh"]))
        name.parent.mkdir(parents=True)
        tsv = rows.drop(columns="participant").rename(columns={"reaction_s": "response_time"})
        tsv["correct"] = tsv["correct"].astype(str).replace("-1", "n/a")
        _write_separated(tsv, name.with_suffix(".tsv"), "\t")
        written += [name.with_suffix(".tsv"), _json(name.with_suffix(".json"), _sidecar(tsv, design))]
    return written


def read_bids(folder: Path) -> DataFrame:
    """Every behavioural table of a BIDS dataset below each other, with the participant as a column.

    Columns that one table lacks are "n/a" there.

    Raises
    ------
    MissingFileError
        If there are none.
    """
    from pandas import DataFrame, concat

    files = sorted(folder.glob("sub-*/**/beh/*_beh.tsv")) + sorted(folder.glob("sub-*/beh/*_beh.tsv"))
    files = list(dict.fromkeys(files))
    if not files:
        raise MissingFileError(f"{folder.name}: expected sub-*/beh/*_beh.tsv, got none; is this a BIDS dataset?")
    parts = [DataFrame({"participant": file.name.split("_")[0], **_words(file)}) for file in files]
    words = concat(parts, ignore_index=True).fillna("n/a").rename(columns={"response_time": "reaction_s"})
    if "correct" in words:
        words["correct"] = words["correct"].replace("n/a", "-1")
    return _typed(words, but=("answer", "right"))


def _words(path: Path) -> DataFrame:
    """The fields as they are written.

    Read line by line: pandas fills a line that is short, shifts one that ends in a comma, and takes "n/a" for nothing.
    """
    from pandas import DataFrame

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
    return DataFrame(rows[1:], columns=rows[0])


def _typed(words: DataFrame, *, but: Sequence[str] = ()) -> DataFrame:
    names = [name for name in words.columns.tolist() if name not in but]
    return words.assign(**{name: _values(words.loc[:, name]) for name in names})


def _values(column: Series) -> Series:
    if column.isin(["true", "false", "True", "False"]).all():
        return column.str.lower() == "true"
    try:
        return column.astype(float)
    except ValueError:
        return column


def _write_separated(table: DataFrame, path: Path, delimiter: str) -> None:
    words = table.copy()
    for name in table.select_dtypes(bool):
        words[name] = np.where(table[name], "true", "false")
    for name in words.select_dtypes(exclude=["number", "bool"]):
        words[name] = words[name].map(no_formula)
    words.rename(columns=no_formula).to_csv(
        path, sep=delimiter, index=False, encoding="utf-8", lineterminator="\n", na_rep="n/a"
    )


def _description(design: Design, simulated: bool, files: str) -> dict[str, Any]:
    stated = {"Authors": list(design.authors), "License": design.license}
    return {
        "Name": ("SIMULATED: " if simulated else "") + (design.title or design.name),
        "BIDSVersion": "1.10.0",
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "midair", "Version": __version__} | ({"Description": files} if files else {})],
    } | {name: value for name, value in stated.items() if value}


def _readme(design: Design, simulated: bool, files: str) -> str:
    first = "SIMULATED: no person took part. These answers come from a model.\n\n" if simulated else ""
    return (
        f"{first}{design.title or design.name}\n\nAnswers of a study of touch in midair, one row an answer. The plan"
        f" was drawn before the first participant with seed {design.seed} for {design.participants} participants.\n"
        + (f"\n{files}\n" if files else "")
    )


def _participants(answers: DataFrame, design: Design, folder: Path, unfinished: Collection[str] | None) -> list[Path]:
    people = answers.groupby("participant", sort=False)
    rows = people["simulated"].agg(simulated="any", answers="size").rename_axis("participant_id").reset_index()
    if unfinished is not None:
        rows["finished"] = [who not in unfinished for who in rows["participant_id"].tolist()]
    form = [design.question(name) for name in design.form if name in answers]
    for question in form:
        rows[question.name] = people[question.name].first().tolist()
    path = folder / "participants.tsv"
    _write_separated(rows, path, "\t")
    meaning = {
        "participant_id": {"Description": "Name of the participant in this dataset."},
        "simulated": {"Description": MEANING["simulated"]},
        "answers": {"Description": "Number of answers that count."},
        **{question.name: {"Description": question.text} for question in form},
    }
    if unfinished is not None:
        meaning["finished"] = {"Description": "Whether the log has an answer to every question, and its end."}
    return [path, _json(folder / "participants.json", meaning)]


def _sidecar(table: DataFrame, design: Design) -> dict[str, Any]:
    meaning = {**MEANING, **{name: design.question(name).text for name in design.form}}
    columns: dict[str, Any] = {
        name: {"Description": meaning.get(name, f"Level of the factor {name}; n/a where it has none.")}
        for name in table
    }
    columns["response_time"]["Units"] = columns["time"]["Units"] = "s"
    columns["question"]["Levels"] = {question.name: question.text for question in design.questions}
    told = [text for text in (design.consent, *(block.text for block in design.blocks)) if text]
    task = {"TaskName": design.name, "TaskDescription": design.title or design.name}
    task |= {"InstitutionName": design.institution} if design.institution else {}
    return {**task, "Instructions": " ".join(told), **columns} if told else {**task, **columns}


def _json(path: Path, content: Mapping[str, Any]) -> Path:
    return _text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def _text(path: Path, content: str) -> Path:
    path.write_text(content, encoding="utf-8")
    return path
