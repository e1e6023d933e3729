"""Asks the inspector, a process of its own, whether an HDF5 file can be read by this one."""

import atexit
import json
import os
import subprocess
import sys
import time
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path
from threading import Lock, Timer

from midair.errors import BrokenFileError
from midair.files.native.hdf5_recovery import openable

PATIENCE = 120.0
"""Seconds until an answer; the inspector's own limit is of processor time."""

REMEMBERED = 256
"""Files that were found plain and are not looked at again."""

SETTLED = 100_000_000
"""Nanoseconds after which a change of a file shows in its time stamp."""

FATAL = "one that HDF5 does not survive or does not end with; it is damaged, or made to do harm"
"""What is said of a file of which the inspector died; it is not shown to another one."""

Look = tuple[int, int, int, int, int]


def inspect(path: Path) -> None:
    """Return if an HDF5 file is one that can be read.

    Raises
    ------
    BrokenFileError
        If it is not, or HDF5 does not survive the look at it.
    """
    look = _look_of(path)
    if look in _PLAIN:
        return
    refused = FATAL if look in _FATAL else _INSPECTOR.ask(path)
    if refused == FATAL:
        _remember(_FATAL, look)
    if refused is not None:
        raise BrokenFileError(f"{path}: expected a plain HDF5 file, got {refused}")
    if time.time_ns() - max(look[3:]) > SETTLED:  # noqa: TID251  # the clock by which files are stamped
        _remember(_PLAIN, look)


def _remember(looks: "OrderedDict[Look, None]", look: Look) -> None:
    looks[look] = None
    while len(looks) > REMEMBERED:
        looks.popitem(last=False)


def get_ready(path: Path) -> None:
    """Let the inspector begin, if it has to look at a file, while this process loads what it needs itself."""
    if (look := _look_of(path)) not in _PLAIN and look not in _FATAL:
        _INSPECTOR.get_ready()


def _look_of(path: Path) -> Look:
    told = path.stat()
    return told.st_dev, told.st_ino, told.st_size, told.st_mtime_ns, told.st_ctime_ns


class _Inspector:
    """The process, which is begun when it is needed, and again when a file was its end."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._owner = 0
        self._lock = Lock()

    def get_ready(self) -> None:
        with self._lock:
            self._running()

    def ask(self, path: Path) -> str | None:
        """What is refused of a file; None if nothing is."""
        with self._lock:
            process = self._running()
            if process is None or process.stdin is None or process.stdout is None:
                # The same look, without the safety of a process of its own.
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
                return FATAL
            return json.loads(line)

    def _running(self) -> "subprocess.Popen[str] | None":
        """The process, begun if it is not there; None on a system that has none to give."""
        # A copy of this process (fork) must not talk through the pipes of the first.
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self._process, self._owner = _begun(), os.getpid()
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
        """End the process; it would end by itself with this one."""
        with self._lock:
            self._end()


def _begun() -> "subprocess.Popen[str] | None":
    # -P: what lies beside the inspector is no library. One thread: it computes nothing.
    words = [sys.executable, "-P", str(Path(__file__).with_name("inspector.py"))]
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
            # Ctrl-C is for this process; the other ends when nobody asks any more.
            start_new_session=True,
        )
    except OSError:
        return None


_PLAIN: "OrderedDict[Look, None]" = OrderedDict()
_FATAL: "OrderedDict[Look, None]" = OrderedDict()
_INSPECTOR = _Inspector()
atexit.register(_INSPECTOR.close)
