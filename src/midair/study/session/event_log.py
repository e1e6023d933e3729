"""The log of a session: one JSON object a line, appended and on disk before anybody is told that it is stored.

Each line ends in a link, a digest of all bytes of the log up to it: whoever changes, removes or inserts a line breaks
the chain from there on. Whoever computes the chain anew is found out by the last link alone, if somebody noted it.
The plan says whether every line has to have a link. Studies of before 2026-11-23 do not: their logs, which may begin
without links, are read as they are, and lines that are appended to one cover what is there.
"""

import json
import os
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Any, Protocol, Self

from midair.errors import BrokenFileError, DeviceStateError, MissingFileError
from midair.files import hold_open, json_of

_LINK = b', "chain": "'
LINK = 32
"""Hexadecimal digits of a link."""


class _Digest(Protocol):
    """A digest that grows."""

    def update(self, data: bytes, /) -> None:
        """Take in more."""
        ...

    def copy(self) -> "_Digest":
        """The same, to go on separately."""
        ...

    def hexdigest(self) -> str:
        """What it is by now."""
        ...


class EventLog:
    """A log that only grows; a context manager that holds the file alone.

    Opening it cuts off a last line that was never finished (its event was never acknowledged) and says so in a
    ``repair`` event.

    Parameters
    ----------
    path : Path
        Created with its folders if it is not there.
    synced : bool
        Whether each event is on the disk, and not only with the system, before `append` returns: it then outlives a
        cut of the power. A killed program loses nothing either way.
    chained : bool
        Whether the lines that are there already have to have links, as `Plan.chain` says.
    """

    def __init__(self, path: Path, *, synced: bool = True, chained: bool = False) -> None:
        self.path = path
        self._chained = chained
        self._synced = synced
        self.seal = ""
        self._file: int | None = None
        self._lock = Lock()
        self._chain: _Digest = sha256()

    def __enter__(self) -> Self:
        # For this user alone, as the log: it holds what people answered.
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        try:
            hold_open(self._file, f"{self.path.name}: another program is running this session; end it first")
            _sync_folder(self.path.parent)
            torn = _cut_torn_line(self._file, self.path)
            _, self._chain = _checked(self.path, self._chained)
            self.seal = chain_hash(self.path)
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
        body = json.dumps(dict(event), ensure_ascii=False).encode()
        with self._lock:
            if self._file is None:
                raise DeviceStateError(f"{self.path.name}: expected an open log; use it as a context manager")
            line, link = _linked(body, self._chain)
            written = line
            while written:
                written = written[os.write(self._file, written) :]
            if self._synced:
                os.fsync(self._file)
            self._chain.update(line)
            self.seal = link


def read_events(path: Path, *, chained: bool = False) -> list[dict[str, Any]]:
    """Every event of a log, without its links; a last line that was never finished does not count.

    Parameters
    ----------
    path : Path
        The log.
    chained : bool
        Whether every line has to have a link, as `Plan.chain` says. If not, lines before the first link need none.

    Raises
    ------
    MissingFileError
        If there is no log.
    BrokenFileError
        If a line within is not an event, or the chain is broken: the log was changed since it was written.
    """
    return _checked(path, chained)[0]


def chain_hash(path: Path) -> str:
    """The last link of a log; empty if it has none."""
    return (links_of(path) or [""])[-1]


def links_of(path: Path) -> list[str]:
    """The link of each line of a log, empty where a line has none: each was the seal when its line was the last."""
    lines = path.read_bytes().split(b"\n")[:-1]
    return [line.rpartition(_LINK)[2][:LINK].decode(errors="replace") if _LINK in line else "" for line in lines]


def _checked(path: Path, chained: bool) -> tuple[list[dict[str, Any]], _Digest]:
    """The events of a log whose chain holds, and the digest with which it goes on."""
    if not path.exists():
        raise MissingFileError(f"{path.name}: expected a log of a session, got no such file; run the session first")
    events: list[dict[str, Any]] = []
    chain: _Digest = sha256()
    linked = chained
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1], start=1):
        try:
            event = json_of(line)
        except ValueError as wrong:
            raise BrokenFileError(f"{path.name}: expected JSON, got damage in line {number}; restore a copy") from wrong
        if not isinstance(event, dict) or "event" not in event:
            raise BrokenFileError(f"{path.name}: expected an event in line {number}, got {line[:40]!r}")
        if linked and "chain" not in event:
            raise BrokenFileError(
                f"{path.name}: expected the chain of what was written, got a break in line {number}: it has no link,"
                " so that it was changed since; restore a copy"
            )
        linked = linked or "chain" in event
        body = line.rpartition(_LINK)[0] + b"}"
        if linked and _linked(body, chain)[0] != line + b"\n":
            raise BrokenFileError(
                f"{path.name}: expected the chain of what was written, got a break in line {number}: it, or a line"
                " before it, was changed since; restore a copy"
            )
        chain.update(line + b"\n")
        event.pop("chain", None)
        events.append(event)
    return events, chain


def _linked(body: bytes, chain: _Digest) -> tuple[bytes, str]:
    """The line of an event with its link, and the link."""
    whole = chain.copy()
    whole.update(body)
    link = whole.hexdigest()[:LINK]
    return body[:-1] + _LINK + link.encode() + b'"}\n', link


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
