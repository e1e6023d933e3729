"""Exclusive locks: only one program uses a device at a time."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote, unquote

from midair.devices.safety.lock_files import LockFile, held_entry
from midair.devices.safety.state_folders import make_state_folder, state_folder
from midair.errors import HeldError


@contextmanager
def device_lock(device: str) -> Generator[None]:
    """While inside, no other program of this user, and no other part of this one, can lock the device.

    The lock is a system lock on a file in the state folder: it ends with the process, and a leftover file does not
    block. Windows has no such lock; there every program gets the device.

    Parameters
    ----------
    device : str
        Name in parts separated by colons: ``autd3``, which may find any units, excludes ``autd3:eth0``, and vice versa.

    Raises
    ------
    HeldError
        If another program uses it.
    FileError
        If the state folder cannot be written.
    """
    path = _path(make_state_folder(), device)
    held = LockFile.take(path)
    if held is None:
        raise HeldError(_refusal(device, path))
    try:
        held.write({"device": device})
        # Lock first, then check the others: of two simultaneous programs at least one detects the other.
        for other in _overlapping(device):
            if held_entry(other) is not None:
                raise HeldError(_refusal(device, other))
        yield
    finally:
        held.release()


def _path(folder: Path, device: str) -> Path:
    return folder / f"device-{quote(device, safe='')}.json"


def _overlapping(device: str) -> list[Path]:
    """Lock files of devices that contain this one or that it contains."""
    others = {unquote(path.stem.removeprefix("device-")): path for path in state_folder().glob("device-*.json")}
    return [
        path
        for name, path in others.items()
        if name != device and (name.startswith(f"{device}:") or device.startswith(f"{name}:"))
    ]


def _refusal(device: str, path: Path) -> str:
    entry = held_entry(path) or {}
    who = (
        f"process {entry.get('process', '?')} ({entry.get('command', '?')}) has had it since {entry.get('since', '?')}"
    )
    return f"{device}: expected a device that no other program uses, {who}; wait until it ends, or end it"
