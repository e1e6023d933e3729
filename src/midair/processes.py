"""Child processes of Python, which import nothing from the current folder: it may hold the files of a stranger."""

import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from threading import Lock
from typing import TYPE_CHECKING, Any

from midair.errors import InputError

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess
    from multiprocessing.synchronize import Event

SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable with which Python, as with its option -P, does not look for modules in the current folder."""

_lock, _blocks = Lock(), 0
_before: str | None = None


def protect_command() -> None:
    """Import nothing from the current folder, where ``python -m`` puts it first, in this program and its children."""
    os.environ[SAFE_PATH] = "1"
    with suppress(FileNotFoundError):
        if not sys.flags.safe_path and sys.path[:1] == [os.getcwd()]:
            del sys.path[0]


def python_command(*words: str) -> list[str]:
    """Command line of another Python program: its options, file or module, and arguments."""
    return [sys.executable, "-P", *words]


@contextmanager
def safe_path() -> Generator[None]:
    """Let no Python process that starts within the block import from the current folder.

    Raises InputError if this program runs with ``python -E``, whose children would not read the environment.
    """
    global _blocks, _before
    if sys.flags.ignore_environment and not sys.flags.safe_path:
        raise InputError(f"python -E: expected child processes that read {SAFE_PATH}, got none; add -P, or use -I")
    with _lock:
        if not _blocks:
            _before, os.environ[SAFE_PATH] = os.environ.get(SAFE_PATH), "1"
        _blocks += 1
    try:
        yield
    finally:
        with _lock:
            _blocks -= 1
            if not _blocks:
                del os.environ[SAFE_PATH]
                os.environ.update({} if _before is None else {SAFE_PATH: _before})


def start_process(target: Callable[..., object], *arguments: Any, name: str, daemon: bool = True) -> "SpawnProcess":
    """Start a process that runs ``target(*arguments)``."""
    from multiprocessing import get_context

    process = get_context("spawn").Process(target=target, args=arguments, name=name, daemon=daemon)
    with safe_path():
        process.start()
    return process


def shared_event() -> "Event":
    """Return an event to pass to `start_process`; the first one starts a process that tracks them."""
    from multiprocessing import get_context

    with safe_path():
        return get_context("spawn").Event()
