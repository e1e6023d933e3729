"""Answers as CSV, and as behavioural tables of the Brain Imaging Data Structure (BIDS 1.10, "beh")."""

import csv
import json
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pandas import DataFrame, concat

from midair.errors import BrokenFileError, FileError, InputError, MissingFileError
from midair.files import atomic_file, atomic_folder, no_formula, read_toml
from midair.study.design.study_design import Design
from midair.study.findings.choice_findings import Finding
from midair.study.findings.study_data import simulation_of
from midair.study.statistics.columns import typed
from midair.version import __version__

_COLUMNS = read_toml(Path(__file__).with_name("columns.toml"), "explanations of columns")
Program = Literal["psychopy", "jspsych"]
"""Other programs whose columns are known."""
MEANING: Mapping[str, str] = _COLUMNS["answers"]
"""Descriptions of the columns of an answers table."""


def legend_of(finding: Finding) -> tuple[tuple[str, str], ...]:
    """Names and explanations of the columns of a finding's table."""
    names, known = [] if finding.table is None else map(str, finding.table.columns), _COLUMNS["report"]
    return tuple((name, known[name]) for name in names if name in known)


def columns_of(table: DataFrame, program: Program, given: Mapping[str, str]) -> dict[str, str]:
    """Columns of a table of another program by their role, as `data_of_columns` takes them, and the loop of practice.

    Those that are `given` by name and exist stay. Raises InputError if several columns may have a role.
    """
    found = {role: name for role, name in given.items() if name and (name in table or role != "participant")}
    for role, pattern in _COLUMNS["programs"][program].items():
        names = [name for name in map(str, table.columns) if re.fullmatch(pattern, name)]
        if len(names) > 1 and role not in found:
            raise InputError(f"--from {program}: expected one column as {role}, got {', '.join(names)}; name it")
        found |= dict.fromkeys({role} - found.keys(), names[0]) if names else {}
    return found


def write_csv(table: DataFrame, path: Path) -> None:
    """Write a table as CSV with a header, atomically; raises FileError if the file exists or cannot be written."""
    if path.exists():
        raise FileError(f"{path.name}: expected a new file, the file exists; choose another name")
    with atomic_file(path) as partial:
        partial.chmod(0o600)  # it contains the answers of participants
        write_separated(table, partial, ",")


def read_csv(path: Path) -> DataFrame:
    """Read a CSV or TSV table with a header; numeric columns become numbers.

    Raises MissingFileError, or BrokenFileError if the file is no such table.
    """
    return _typed(_read_fields(path))


def write_bids(
    answers: DataFrame,
    design: Design,
    folder: Path,
    *,
    unfinished: Collection[str] | None = None,
    markers: DataFrame | None = None,
) -> list[Path]:
    """Write answers as a BIDS dataset: ``sub-NN/beh/sub-NN_task-NAME_beh.tsv`` with a JSON sidecar per participant.

    With several sessions: ``sub-NN/ses-MM/beh/sub-NN_ses-MM_task-NAME_beh.tsv``. `answers` is the result of
    `answers_table`; texts and factors of the design go to the sidecars. `unfinished` are the participants with
    unfinished sessions, for a column of the participants (no column if None); `markers`, the result of `markers_table`,
    is written as ``*_events.tsv`` beside the answers. Returns the written files. Raises FileError if the folder is not
    empty and InputError if there are no answers.
    """
    if answers.empty:
        raise InputError("export: expected answers, got none; run a participant first")
    with atomic_folder(folder) as partial:
        written = _dataset(answers, design, partial, unfinished, markers)
        for inside in (partial, *partial.rglob("*")):  # contains the answers of participants
            inside.chmod(0o700 if inside.is_dir() else 0o600)
        return [folder / path.relative_to(partial) for path in written]


def _dataset(
    answers: DataFrame, design: Design, folder: Path, unfinished: Collection[str] | None, markers: DataFrame | None
) -> list[Path]:
    simulated = bool(answers["simulated"].any())
    written = [write_text(folder / "README", readme_of(design, simulation_of(answers)))]
    written.append(write_json(folder / "dataset_description.json", _description(design, simulated)))
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
        write_separated(tsv, name.with_suffix(".tsv"), "\t")
        written += [name.with_suffix(".tsv"), write_json(name.with_suffix(".json"), _sidecar(tsv, design))]
        if markers is not None and not markers.empty:
            here = (markers["participant"] == person) & (
                markers["session"] == rows["session"].iloc[0] if in_folders else True
            )
            written += _events(markers.loc[here], name.with_name(name.name.removesuffix("beh") + "events"))
    return written


def _events(markers: DataFrame, name: Path) -> list[Path]:
    """Write the markers of a session as a BIDS table of events with its sidecar."""
    if markers.empty:
        return []
    events = markers.drop(columns=["participant", "session"]).sort_values("onset", kind="stable")
    write_separated(events, name.with_suffix(".tsv"), "\t")
    return [name.with_suffix(".tsv"), write_json(name.with_suffix(".json"), _COLUMNS["events"])]


def read_bids(folder: Path) -> DataFrame:
    """Concatenate all behavioural tables of a BIDS dataset, with the participant as a column.

    Missing columns are filled with "n/a". Raises MissingFileError if there are no tables.
    """
    files = sorted(folder.glob("sub-*/**/beh/*_beh.tsv"))
    if not files:
        raise MissingFileError(f"{folder.name}: expected sub-*/beh/*_beh.tsv, got none; is this a BIDS dataset?")
    parts = [DataFrame({"participant": file.name.split("_")[0], **_read_fields(file)}) for file in files]
    words = concat(parts, ignore_index=True).fillna("n/a").rename(columns={"response_time": "reaction_s"})
    if "correct" in words:
        words["correct"] = words["correct"].replace("n/a", "-1")
    return _typed(words, but=("answer", "right"))


def _read_fields(path: Path) -> DataFrame:
    """Fields of a table as text.

    Read line by line: pandas fills short lines, shifts lines that end in a comma, and reads "n/a" as missing.
    """
    if not path.is_file():
        raise MissingFileError(f"{path.name}: expected a table, the file does not exist; check the path")
    delimiter = "\t" if path.suffix == ".tsv" else ","
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file, delimiter=delimiter, strict=True))
    except (csv.Error, UnicodeDecodeError) as wrong:
        raise BrokenFileError(f"{path.name}: expected a table in UTF-8, got: {wrong}") from wrong
    rows = [row for row in rows if row]
    if len(rows) < 2 or len(set(rows[0])) < len(rows[0]):
        raise BrokenFileError(
            f"{path.name}: expected a header of different names and rows of answers, got {len(rows)} lines"
        )
    uneven = next((i for i, row in enumerate(rows, start=1) if len(row) != len(rows[0])), None)
    if uneven:
        raise BrokenFileError(
            f"{path.name}: expected {len(rows[0])} fields per line, got {len(rows[uneven - 1])} in line {uneven}"
        )
    return DataFrame(rows[1:], columns=rows[0])


def _typed(words: DataFrame, *, but: Sequence[str] = ()) -> DataFrame:
    names = [name for name in words.columns.tolist() if name not in but]
    return words.assign(**{name: typed(words.loc[:, name]) for name in names})


def write_separated(table: DataFrame, path: Path, delimiter: str) -> None:
    """Write a table with a header; fields that a spreadsheet would run as formulas get an apostrophe."""
    words = table.copy()
    for name in table.select_dtypes(bool):
        words[name] = np.where(table[name], "true", "false")
    for name in words.select_dtypes(exclude=["number", "bool"]):
        words[name] = words[name].map(no_formula)
    words.rename(columns=no_formula).to_csv(
        path, sep=delimiter, index=False, encoding="utf-8", lineterminator="\n", na_rep="n/a"
    )


def _description(design: Design, simulated: bool) -> dict[str, Any]:
    stated = {"Authors": list(design.authors), "License": design.license}
    return {
        "Name": ("SIMULATED: " if simulated else "") + (design.title or design.name),
        "BIDSVersion": "1.10.0",
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "midair", "Version": __version__}],
    } | {name: value for name, value in stated.items() if value}


def readme_of(design: Design, simulated: str) -> str:
    """Text of the README of a dataset."""
    first = f"{simulated}.\n\n" if simulated else ""
    return (
        f"{first}{design.title or design.name}\n\nAnswers of a study of touch in midair, one row per answer. The plan"
        f" was drawn before the first participant with seed {design.seed} for {design.participants} participants.\n"
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
    write_separated(rows, path, "\t")
    meaning = {
        **{name: {"Description": MEANING[name]} for name in ("participant_id", "simulated")},
        "answers": {"Description": "Number of valid answers."},
        **{question.name: {"Description": question.text} for question in form},
    }
    if unfinished is not None:
        meaning["finished"] = {
            "Description": "Whether the log contains an answer to every question and the end of the session."
        }
    return [path, write_json(folder / "participants.json", meaning)]


def _sidecar(table: DataFrame, design: Design) -> dict[str, Any]:
    columns: dict[str, Any] = {str(name): {"Description": column_meaning(str(name), design)} for name in table}
    columns["response_time"]["Units"] = columns["time"]["Units"] = "s"
    columns["question"]["Levels"] = {question.name: question.text for question in design.questions}
    instructions = [text for text in (design.consent, *(block.text for block in design.blocks)) if text]
    task = {"TaskName": design.name, "TaskDescription": design.title or design.name}
    task |= {"InstitutionName": design.institution} if design.institution else {}
    return {**task, "Instructions": " ".join(instructions), **columns} if instructions else {**task, **columns}


def column_meaning(name: str, design: Design) -> str:
    """Description of a column of an exported table of answers."""
    meaning = {**MEANING, **{asked: design.question(asked).text for asked in design.form}}
    return meaning.get(name, f"Level of the factor {name}; n/a if it has none.")


def write_json(path: Path, content: Mapping[str, Any]) -> Path:
    """Write JSON and return the path."""
    return write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def write_text(path: Path, content: str) -> Path:
    """Write text and return the path."""
    path.write_text(content, encoding="utf-8")
    return path
