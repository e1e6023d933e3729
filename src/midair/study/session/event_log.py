"""Append-only log of a session: one JSON object per line, written to disk before the session continues."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from threading import Lock
from typing import Any, Self

from midair.errors import BrokenFileError, DeviceStateError, MissingFileError
from midair.files import json_of, lock_or_raise


class EventLog:
    """Append-only log as a context manager that locks the file.

    Opening removes an incomplete last line, whose event was never confirmed, and records it in a ``repair`` event. With
    `synced` each event is on the disk before `append` returns, so that it survives a power failure; an event survives
    the end of the program in any case.
    """

    def __init__(self, path: Path, *, synced: bool = True) -> None:
        self.path = path
        self._synced = synced
        self._file: int | None = None
        self._lock = Lock()

    def __enter__(self) -> Self:
        # Readable by this user only, like the log: it contains the answers of participants.
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        try:
            lock_or_raise(self._file, f"{self.path.name}: another program is running this session; end it first")
            _sync_folder(self.path.parent)
            torn = _remove_torn_line(self._file, self.path)
            read_events(self.path)  # raises for a damaged log before anything is appended
            if torn:
                self.append({"event": "repair", "torn": torn})
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file and release its lock."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def append(self, event: Mapping[str, Any]) -> None:
        """Write one event; raises DeviceStateError if the log is not open."""
        written = json.dumps(dict(event), ensure_ascii=False).encode() + b"\n"
        with self._lock:
            if self._file is None:
                raise DeviceStateError(f"{self.path.name}: expected an open log; use it as a context manager")
            while written:
                written = written[os.write(self._file, written) :]
            if self._synced:
                os.fsync(self._file)


def read_events(path: Path) -> list[dict[str, Any]]:
    """Every event of a log; an incomplete last line is ignored.

    Raises MissingFileError if the log does not exist, and BrokenFileError if a line is not an event.
    """
    if not path.exists():
        raise MissingFileError(
            f"{path.name}: expected the log of a session, the file does not exist; run the session first"
        )
    events: list[dict[str, Any]] = []
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1], start=1):
        try:
            event = json_of(line)
        except ValueError as wrong:
            raise BrokenFileError(f"{path.name}: expected JSON, got damage in line {number}; restore a copy") from wrong
        if not isinstance(event, dict) or "event" not in event:
            raise BrokenFileError(f"{path.name}: expected an event in line {number}, got {line[:40]!r}")
        events.append(event)
    return events


def _remove_torn_line(file: int, path: Path) -> str:
    content = path.read_bytes()
    end = content.rfind(b"\n") + 1
    if end == len(content):
        return ""
    os.ftruncate(file, end)
    os.fsync(file)
    return content[end:].decode(errors="replace")


def _sync_folder(folder: Path) -> None:
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
