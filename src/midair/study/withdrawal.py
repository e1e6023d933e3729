"""Withdrawal of a participant: deletes the log and all derived data."""

import errno
import json
import os
import shutil
from pathlib import Path
from typing import Any

from midair.errors import FileError, InputError
from midair.files import atomic_file, json_of, lock_or_raise
from midair.study.folder import StudyFolder

MADE = "made.jsonl"
"""File that lists derived reports, datasets and tables, one per line, for the deletion of a participant."""

WITHDRAWN = "withdrawn.jsonl"
"""File with the numbers of withdrawn participants, one per line."""


def log_derived_file(folder: StudyFolder, path: Path, kind: str) -> None:
    """Record a report, BIDS dataset or table that was derived from the answers of a study."""
    home, path = folder.path.resolve(), path.resolve()
    if (path, kind) not in [(home / entry["path"], entry["kind"]) for entry in _entries(folder.path / MADE)]:
        # Relative inside the study, whose folder may be moved.
        inside = path.relative_to(home).as_posix() if path.is_relative_to(home) else str(path)
        _append(folder.path / MADE, {"path": inside, "kind": kind})


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
    """Delete all data of one participant: the log, and the data in all recorded derived files.

    Rows and folders of the participant are removed from datasets and tables, which keep all others. Reports are
    deleted, since their figures contain all participants. After an interruption, call it again to complete the
    deletion. Returns one line for each deleted file and each remaining manual step. Raises InputError if no log exists
    for this participant, and DeviceStateError if the session is running.
    """
    log, person = folder.log(participant), f"sub-{participant:02d}"
    before = participant in withdrawn(folder)
    if not log.exists() and not before:
        raise InputError(f"participant: expected the number of a participant with a log, got {participant}")
    if not log.exists():
        return _delete_from_derived(folder, person)
    handle = os.open(log, os.O_RDWR)
    try:
        lock_or_raise(handle, f"{log.name}: another program is running this session; end it first")
        if not before:
            _append(folder.path / WITHDRAWN, {"participant": participant})
        lines = log.read_bytes().count(b"\n")
        report = _delete_from_derived(folder, person)
        log.unlink()
    finally:
        os.close(handle)
    return [*report, f"{log.relative_to(folder.path)}: deleted, {lines} lines"]


def _delete_from_derived(folder: StudyFolder, person: str) -> list[str]:
    report: list[str] = []
    for entry in _entries(folder.path / MADE):
        path, kind = folder.path.resolve() / entry["path"], entry["kind"]
        if not path.exists():
            report.append(f"{path}: not found; if it was moved, delete the participant from it by hand")
        elif kind == "report":
            path.unlink()
            report.append(f"{path}: deleted; `midair study analyse` creates it again without the participant")
        elif kind == "csv":
            report.append(_delete_rows(path, ",", person))
        else:
            report += _delete_from_dataset(path, person)
    return report


def _delete_from_dataset(path: Path, person: str) -> list[str]:
    report = [_delete_rows(path / "participants.tsv", "\t", person)] if (path / "participants.tsv").exists() else []
    for data in (path / person, path / "data" / person):  # of BIDS, of Psych-DS
        if data.is_dir():
            files = sum(one.is_file() for one in data.rglob("*"))
            shutil.rmtree(data)
            report.append(f"{data}: deleted, {files} files")
    return report


def _delete_rows(path: Path, separator: str, person: str) -> str:
    """Remove a participant's rows from a table with the participant in its first column; other bytes stay."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if line.partition(separator)[0] != person]
    if len(kept) < len(lines):
        with atomic_file(path) as partial:
            partial.chmod(0o600)
            partial.write_text("".join(kept), encoding="utf-8")
    return f"{path}: {len(lines) - len(kept)} rows deleted"


def _entries(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    try:
        return [dict(json_of(line)) for line in path.read_bytes().split(b"\n")[:-1]]
    except (ValueError, TypeError) as wrong:
        raise FileError(f"{path.name}: expected one JSON object per line, got other content; restore a copy") from wrong


def _append(path: Path, entry: dict[str, Any]) -> None:
    """Append one whole line and sync, or nothing: half a line would make the study unreadable."""
    line = (json.dumps(entry) + "\n").encode()
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        try:
            size = os.fstat(handle).st_size
            if os.write(handle, line) < len(line):
                os.ftruncate(handle, size)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as wrong:
        raise FileError(
            f"{path}: cannot be written: {wrong.strerror or wrong}; the folder of a study lists the files derived "
            "from its answers, which withdrawals need: free disk space and allow writing"
        ) from wrong
