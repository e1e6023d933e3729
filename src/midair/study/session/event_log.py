"""Append-only log of a session: one JSON object per line, written to disk before the session continues.

Each line ends with a chain hash, a digest of all bytes of the log up to that point. A changed, removed or inserted line
breaks the chain; a log rewritten with a new chain differs in its last hash, which the experimenter can note. The plan
states whether every line needs a hash. Logs of studies from before 2026-11-23 may begin without; lines appended to them
have hashes that cover the earlier lines.
"""

import json
import os
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Self

from midair.errors import BrokenFileError, DeviceStateError, MissingFileError
from midair.files import json_of, lock_or_raise

if TYPE_CHECKING:
    from _hashlib import HASH

_LINK = b', "chain": "'
LINK = 32
"""Number of hexadecimal digits of a chain hash."""


class EventLog:
    """Append-only log as a context manager that locks the file.

    Opening removes an incomplete last line, whose event was never confirmed, and records it in a ``repair`` event. With
    `synced` each event is on the disk before `append` returns, so that it survives a power failure; an event survives
    the end of the program in any case. `chained` requires a chain hash in every existing line, as `Plan.chain`.
    """

    def __init__(self, path: Path, *, synced: bool = True, chained: bool = False) -> None:
        self.path = path
        self._chained = chained
        self._synced = synced
        self.seal = ""
        self._file: int | None = None
        self._lock = Lock()
        self._chain = sha256()

    def __enter__(self) -> Self:
        # Readable by this user only, like the log: it contains the answers of participants.
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        try:
            lock_or_raise(self._file, f"{self.path.name}: another program is running this session; end it first")
            _sync_folder(self.path.parent)
            torn = _remove_torn_line(self._file, self.path)
            _, self._chain = _read_chain(self.path, self._chained)
            self.seal = chain_hash(self.path)
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
        """Write one event with its chain hash; raises DeviceStateError if the log is not open."""
        body = json.dumps(dict(event), ensure_ascii=False).encode()
        with self._lock:
            if self._file is None:
                raise DeviceStateError(f"{self.path.name}: expected an open log; use it as a context manager")
            line, link = _chained_line(body, self._chain)
            written = line
            while written:
                written = written[os.write(self._file, written) :]
            if self._synced:
                os.fsync(self._file)
            self._chain.update(line)
            self.seal = link


def read_events(path: Path, *, chained: bool = False) -> list[dict[str, Any]]:
    """Every event of a log without its chain hash; an incomplete last line is ignored.

    With `chained` every line needs a chain hash, as `Plan.chain`; without, lines before the first hash need none.
    Raises MissingFileError if the log does not exist, and BrokenFileError if a line is not an event, or the chain is
    broken: the log was changed after it was written.
    """
    return _read_chain(path, chained)[0]


def chain_hash(path: Path) -> str:
    """Last chain hash of a log; empty if it has none."""
    return (chain_hashes(path) or [""])[-1]


def chain_hashes(path: Path) -> list[str]:
    """Chain hash of each line of a log, empty where a line has none."""
    lines = path.read_bytes().split(b"\n")[:-1]
    return [line.rpartition(_LINK)[2][:LINK].decode(errors="replace") if _LINK in line else "" for line in lines]


def _read_chain(path: Path, chained: bool) -> tuple[list[dict[str, Any]], "HASH"]:
    """Events of a log with a valid chain, and the digest state for the next line."""
    if not path.exists():
        raise MissingFileError(
            f"{path.name}: expected the log of a session, the file does not exist; run the session first"
        )
    events: list[dict[str, Any]] = []
    chain = sha256()
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
                f"{path.name}: expected an unbroken chain of hashes, got a break in line {number}: it has no"
                " hash, so it was changed after it was written; restore a copy"
            )
        linked = linked or "chain" in event
        body = line.rpartition(_LINK)[0] + b"}"
        if linked and _chained_line(body, chain)[0] != line + b"\n":
            raise BrokenFileError(
                f"{path.name}: expected an unbroken chain of hashes, got a break in line {number}: this or an"
                " earlier line was changed after it was written; restore a copy"
            )
        chain.update(line + b"\n")
        event.pop("chain", None)
        events.append(event)
    return events, chain


def _chained_line(body: bytes, chain: "HASH") -> tuple[bytes, str]:
    """Line of an event with its chain hash, and the hash."""
    whole = chain.copy()
    whole.update(body)
    link = whole.hexdigest()[:LINK]
    return body[:-1] + _LINK + link.encode() + b'"}\n', link


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
