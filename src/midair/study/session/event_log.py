"""The log of a session: one JSON object a line, appended and on disk before anybody is told that it is stored."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Any, Self

from midair.errors import BrokenFileError, DeviceStateError, MissingFileError
from midair.files import hold, json_of


class EventLog:
    """A log that only grows; a context manager that holds the file alone.

    Opening it cuts off a last line that was never finished (its event was never acknowledged) and says so in a
    ``repair`` event.

    Parameters
    ----------
    path : Path
        Created with its folders if it is not there.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: int | None = None
        self._lock = Lock()

    def __enter__(self) -> Self:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # For this user alone: it holds what a person answered.
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        try:
            hold(self._file, f"{self.path.name}: another program is running this session; end it first")
            _sync_folder(self.path.parent)
            torn = _cut_torn_line(self._file, self.path)
            read_events(self.path)
            if torn:
                self.append({"event": "repair", "torn": torn})
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def append(self, event: Mapping[str, Any]) -> None:
        """Store an event; when this returns it is on disk.

        Raises
        ------
        DeviceStateError
            If the log is not open.
        """
        line = (json.dumps(dict(event), ensure_ascii=False) + "\n").encode()
        with self._lock:
            if self._file is None:
                raise DeviceStateError(f"{self.path.name}: expected an open log; use it as a context manager")
            while line:
                line = line[os.write(self._file, line) :]
            os.fsync(self._file)


def read_events(path: Path) -> list[dict[str, Any]]:
    """Every event of a log; a last line that was never finished does not count.

    Raises
    ------
    MissingFileError
        If there is no log.
    BrokenFileError
        If a line within is not an event.
    """
    if not path.exists():
        raise MissingFileError(f"{path.name}: expected a log of a session, got no such file; run the session first")
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


def _cut_torn_line(file: int, path: Path) -> str:
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
