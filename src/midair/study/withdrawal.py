"""Reports, datasets and tables of a study, and their renewal when a participant withdraws."""

import json
import os
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from pandas import DataFrame

from midair.devices import append_line
from midair.errors import FileError, InputError, MidairError
from midair.files import json_of, lock_or_raise, write_file
from midair.study.design.session_state import SessionState, answers_table, markers_table, unfinished_sessions
from midair.study.findings.analysis import Report, analyse
from midair.study.folder import StudyFolder, data_of_study
from midair.study.r_script import script_of_plan
from midair.study.study_report import report_page
from midair.study.tables import write_bids, write_csv

MADE = "made.jsonl"
"""File that lists derived reports, datasets and tables, one per line, to make them again without a participant."""

WITHDRAWN = "withdrawn.jsonl"
"""File with the numbers of withdrawn participants, one per line."""

ExportFormat = Literal["bids", "csv"]


def write_report(folder: StudyFolder, path: Path, *, seed: int = 0, draws: int = 10_000) -> Report:
    """Analyse a study and write its report as HTML; `seed` and `draws` are those of `analyse`.

    Raises the errors of `data_of_study`.
    """
    design, data = folder.plan().design, data_of_study(folder)
    report = analyse(data, seed=seed, draws=draws)
    log_derived_file(folder, path, "report", seed=seed, draws=draws)
    write_file(path, report_page(report, title=design.title or design.name, within=data.within), private=True)
    return report


def export(folder: StudyFolder, path: Path, kind: ExportFormat) -> list[Path]:
    """Write the answers of a study as a BIDS dataset, or as a CSV table with an R script beside it.

    Returns the written files. Raises InputError without answers, and FileError if a file exists or the folder is not
    empty.
    """
    plan, script = folder.plan(), path.with_suffix(".R")
    if kind == "csv" and script.exists():
        raise FileError(f"{script.name}: expected a new file beside {path.name}, the file exists; choose another name")
    _answers(folder)
    # Logged before the export exists, so that a withdrawal also finds an interrupted one.
    log_derived_file(folder, path, kind)
    written = _write(folder, path, kind)
    if kind == "csv":
        text = script_of_plan(plan.design, table=path.name, script=script.name)
        write_file(script, text, private=True)
        written.append(script)
    return written


def _answers(folder: StudyFolder) -> tuple[list[SessionState], DataFrame]:
    sessions = folder.sessions()
    if (answers := answers_table(folder.plan(), sessions)).empty:
        raise InputError("export: expected answers, got none; run a participant first")
    return sessions, answers


def _write(folder: StudyFolder, path: Path, kind: ExportFormat) -> list[Path]:
    plan, (sessions, answers) = folder.plan(), _answers(folder)
    if kind == "bids":
        unfinished = tuple(unfinished_sessions(sessions))
        return write_bids(answers, plan.design, path, unfinished=unfinished, markers=markers_table(sessions))
    write_csv(answers, path)
    return [path]


def log_derived_file(folder: StudyFolder, path: Path, kind: str, **options: int) -> None:
    """Record a report, BIDS dataset or table that was derived from the answers of a study, and the options of it."""
    home, path = folder.path.resolve(), path.resolve()
    # Relative inside the study, whose folder may be moved.
    inside = path.relative_to(home).as_posix() if path.is_relative_to(home) else str(path)
    entry = {"path": inside, "kind": kind, **options}
    if entry not in _entries(folder.path / MADE):
        _append(folder.path / MADE, entry)


def withdrawn(folder: StudyFolder) -> frozenset[int]:
    """Numbers of withdrawn participants."""
    return frozenset(int(entry["participant"]) for entry in _entries(folder.path / WITHDRAWN))


def check_not_withdrawn(folder: StudyFolder, participant: int) -> None:
    """Raise InputError if a participant has withdrawn: the number is not used again."""
    if participant in withdrawn(folder):
        raise InputError(
            f"participant {participant}: expected an active participant, this one has withdrawn; use another number"
        )


def withdraw(folder: StudyFolder, participant: int) -> list[str]:
    """Delete the log of a participant, and all recorded derived files, which are made again without the participant.

    After an interruption, call it again to complete the deletion. Returns one line for each file and each remaining
    manual step. Raises InputError if no log exists for this participant, and DeviceStateError if the session is
    running.
    """
    log, told = folder.log(participant), list[str]()
    before = participant in withdrawn(folder)
    if not log.exists() and not before:
        raise InputError(f"participant: expected the number of a participant with a log, got {participant}")
    if log.exists():
        handle = os.open(log, os.O_RDWR)
        try:
            lock_or_raise(handle, f"{log.name}: another program is running this session; end it first")
            if not before:
                _append(folder.path / WITHDRAWN, {"participant": participant})
            lines = log.read_bytes().count(b"\n")
            log.unlink()
        finally:
            os.close(handle)
        told.append(f"{log.relative_to(folder.path)}: deleted, {lines} lines")
    latest = {entry["path"]: entry for entry in _entries(folder.path / MADE)}
    return told + [_renew(folder, entry, f"sub-{participant:02d}") for entry in latest.values()]


def _renew(folder: StudyFolder, entry: dict[str, Any], person: str) -> str:
    """Delete a derived file and make it again; only files that midair wrote, since a dataset may hold others."""
    path, kind = folder.path.resolve() / entry["path"], entry["kind"]
    if not path.exists():
        return f"{path}: not found; if it was moved, delete the participant from it by hand"
    if kind == "bids":
        shutil.rmtree(path / person, ignore_errors=True)
        (path / "participants.tsv").unlink(missing_ok=True)
    else:
        path.unlink()
    try:
        if kind == "report":
            write_report(folder, path, seed=entry["seed"], draws=entry["draws"])
        elif kind == "csv":
            _write(folder, path, "csv")
        else:
            with TemporaryDirectory(dir=path.parent) as fresh:
                for file in _write(folder, Path(fresh) / "bids", "bids"):
                    file.replace(path / file.relative_to(Path(fresh) / "bids"))
    except MidairError as wrong:
        return f"{path}: deleted, not made again: {wrong}"
    return f"{path}: made again without the participant"


def _entries(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    try:
        return [dict(json_of(line)) for line in path.read_bytes().split(b"\n")[:-1]]
    except (ValueError, TypeError) as wrong:
        raise FileError(f"{path.name}: expected one JSON object per line, got other content; restore a copy") from wrong


def _append(path: Path, entry: dict[str, Any]) -> None:
    """Append one whole line and sync, or nothing: half a line would make the study unreadable."""
    try:
        append_line(path, (json.dumps(entry) + "\n").encode())
    except OSError as wrong:
        raise FileError(
            f"{path}: cannot be written: {wrong.strerror or wrong}; the folder of a study lists the files derived "
            "from its answers, which withdrawals need: free disk space and allow writing"
        ) from wrong
