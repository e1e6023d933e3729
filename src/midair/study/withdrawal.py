"""A person who withdraws: deleted everywhere, and whoever asked is told what was deleted."""

import errno
import json
import os
import shutil
from pathlib import Path
from typing import Any

from midair.errors import FileError, InputError
from midair.files import hold_open, json_of, whole_file
from midair.study.folder import StudyFolder

MADE = "made.jsonl"
"""What was made of a study's answers and where, one line each, so that a person can be taken out of it."""

WITHDRAWN = "withdrawn.jsonl"
"""Numbers of people who withdrew, one line each."""


def log_derived_file(folder: StudyFolder, path: Path, kind: str) -> None:
    """Note that a report, a BIDS dataset or a table was made of the answers of a study."""
    known = [(entry["path"], entry["kind"]) for entry in _entries(folder.path / MADE)]
    if (entry := (str(path.resolve()), kind)) not in known:
        _append(folder.path / MADE, {"path": entry[0], "kind": kind})


def withdrawn(folder: StudyFolder) -> frozenset[int]:
    """Numbers of the people who withdrew."""
    return frozenset(int(entry["participant"]) for entry in _entries(folder.path / WITHDRAWN))


def check_not_withdrawn(folder: StudyFolder, participant: int) -> None:
    """Raise InputError if a participant has withdrawn: the number stays empty."""
    if participant in withdrawn(folder):
        raise InputError(f"participant {participant}: expected somebody who takes part, got one who withdrew")


def withdraw(folder: StudyFolder, participant: int) -> list[str]:
    """Delete everything that one person said, in the log and in all that is known to be made of it.

    What holds other people's answers too keeps those: rows and folders of the one are taken out of datasets and
    tables. Reports are deleted, since their figures are made of everybody. If the program ends in the middle, the same
    call goes on.

    Parameters
    ----------
    folder : StudyFolder
        The study.
    participant : int
        Number, from 1 on.

    Returns
    -------
    list of str
        What was deleted, and what is to be done by hand, one line each.

    Raises
    ------
    InputError
        If nobody of this number took part.
    DeviceStateError
        If the session is running.
    """
    log, person = folder.log(participant), f"sub-{participant:02d}"
    before = participant in withdrawn(folder)
    if not log.exists() and not before:
        raise InputError(f"participant: expected the number of somebody who took part, got {participant}")
    said: list[str] = []
    if log.exists():
        handle = os.open(log, os.O_RDWR)
        try:
            hold_open(handle, f"{log.name}: another program is running this session; end it first")
            if not before:
                _append(folder.path / WITHDRAWN, {"participant": participant})
            lines = log.read_bytes().count(b"\n")
            said += _out_of_all(folder, person)
            log.unlink()
        finally:
            os.close(handle)
        said.append(f"{log.relative_to(folder.path)}: deleted, {lines} lines")
    else:
        said += _out_of_all(folder, person)
    return said


def _out_of_all(folder: StudyFolder, person: str) -> list[str]:
    said: list[str] = []
    for entry in _entries(folder.path / MADE):
        path, kind = Path(entry["path"]), entry["kind"]
        if not path.exists():
            said.append(f"{path}: not there; delete the person from it by hand if it went elsewhere")
        elif kind == "report":
            path.unlink()
            said.append(f"{path}: deleted; `midair study analyse` makes it again without the person")
        elif kind == "csv":
            said.append(_rows_out(path, ",", person))
        else:
            said += _out_of_dataset(path, person)
    return said


def _out_of_dataset(path: Path, person: str) -> list[str]:
    said = [_rows_out(path / "participants.tsv", "\t", person)] if (path / "participants.tsv").exists() else []
    if (path / person).is_dir():
        files = sum(one.is_file() for one in (path / person).rglob("*"))
        shutil.rmtree(path / person)
        said.append(f"{path / person}: deleted, {files} files")
    return said


def _rows_out(path: Path, separator: str, person: str) -> str:
    """Take the rows of a person out of a table whose first column says who; other rows stay byte by byte."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if line.partition(separator)[0] != person]
    if len(kept) < len(lines):
        with whole_file(path) as partial:
            partial.chmod(0o600)
            partial.write_text("".join(kept), encoding="utf-8")
    return f"{path}: {len(lines) - len(kept)} rows deleted"


def _entries(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    try:
        return [dict(json_of(line)) for line in path.read_bytes().split(b"\n")[:-1]]
    except (ValueError, TypeError) as wrong:
        raise FileError(f"{path.name}: expected one JSON object a line, got something else; restore a copy") from wrong


def _append(path: Path, entry: dict[str, Any]) -> None:
    """A whole line on the disk, or none: half of one would keep the study from being read."""
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
            f"{path}: cannot be written: {wrong.strerror or wrong}; a study's folder notes what was made of its "
            "answers, so that a person can be taken out of it: give it room and the right to write"
        ) from wrong
