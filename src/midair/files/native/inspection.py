"""Client of the inspector, a separate process that checks whether an HDF5 file is safe to read."""

import atexit
import json
import os
import subprocess
import time
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path
from threading import Lock, Timer

from midair.errors import BrokenFileError, FileError
from midair.files.native.hdf5_recovery import openable
from midair.processes import python_command
from midair.ram import address_limit

PATIENCE = 120.0
"""Time limit for an answer in s; the inspector's own limit is in CPU time."""

REMEMBERED = 256
"""Number of checked files that are remembered and not checked again."""

SETTLED = 100_000_000
"""Resolution of file time stamps, in ns, within which a change may be invisible."""

ADDRESS_SPACE = 2**31
"""Address space in bytes that the inspector limits itself to; with less, a good file may end it."""

FATAL = "one on which HDF5 crashes or hangs; it is damaged or malicious"
"""Reason for a file that crashed the inspector; it is not inspected again."""

Look = tuple[int, int, int, int, int]


def inspect(path: Path) -> None:
    """Return if an HDF5 file is safe to read; otherwise raise BrokenFileError."""
    key = _identity(path)
    if key in _PLAIN:
        return
    refused = FATAL if key in _FATAL else _INSPECTOR.ask(path)
    if refused == FATAL:
        _remember(_FATAL, key)
    if refused is not None:
        raise BrokenFileError(f"{path}: expected a plain HDF5 file, got {refused}")
    if time.time_ns() - max(key[3:]) > SETTLED:  # noqa: TID251  # the clock by which files are stamped
        _remember(_PLAIN, key)


def _remember(keys: "OrderedDict[Look, None]", key: Look) -> None:
    keys[key] = None
    while len(keys) > REMEMBERED:
        keys.popitem(last=False)


def get_ready(path: Path) -> None:
    """Start the inspector if it will have to check this file, while this process loads its own libraries."""
    if (key := _identity(path)) not in _PLAIN and key not in _FATAL:
        _INSPECTOR.get_ready()


def _identity(path: Path) -> Look:
    status = path.stat()
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


class _Inspector:
    """The inspector process, which is started on demand, and again after a crash."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._owner = 0
        self._lock = Lock()

    def get_ready(self) -> None:
        with self._lock:
            self._running()

    def ask(self, path: Path) -> str | None:
        """The reason to reject a file, or None."""
        with self._lock:
            process = self._running()
            if process is None or process.stdin is None or process.stdout is None:
                # The same check in this process, without protection from crashes.
                from midair.files.native.inspector import refusal

                return refusal(path, openable)
            late = Timer(PATIENCE, process.kill)
            late.daemon = True
            late.start()
            line = ""
            with suppress(BrokenPipeError):
                process.stdin.write(json.dumps(os.path.abspath(path)) + "\n")
                process.stdin.flush()
                line = process.stdout.readline()
            late.cancel()
            if not line:
                self._end()
                if (limit := address_limit()) is not None and limit < ADDRESS_SPACE:
                    raise FileError(
                        f"{path}: expected an answer from the process that checks the file, it ended within the limit "
                        f"of {limit / 1e9:.2g} GB of address space (ulimit -v); raise the limit to "
                        f"{ADDRESS_SPACE / 1e9:.2g} GB or more"
                    )
                return FATAL
            return json.loads(line)

    def _running(self) -> "subprocess.Popen[str] | None":
        """The process, started if necessary; None where the system cannot start one."""
        # A forked copy of this process must not use the pipes of the original.
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self._process, self._owner = _started(), os.getpid()
        return self._process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None or self._owner != os.getpid():
            return
        process.kill()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
        process.wait()

    def close(self) -> None:
        """End the process; it would also end with this one."""
        with self._lock:
            self._end()


def _started() -> "subprocess.Popen[str] | None":
    # One thread, because it computes nothing.
    words = python_command(str(Path(__file__).with_name("inspector.py")))
    quiet = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"}
    try:
        return subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            env=quiet,
            # Ctrl-C is for this process only; the inspector ends when its input is closed.
            start_new_session=True,
        )
    except OSError:
        return None


_PLAIN: "OrderedDict[Look, None]" = OrderedDict()
_FATAL: "OrderedDict[Look, None]" = OrderedDict()
_INSPECTOR = _Inspector()
atexit.register(_INSPECTOR.close)
