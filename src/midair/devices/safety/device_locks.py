"""One program a device: whoever comes second is told who came first."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote, unquote

from midair.devices.safety.lock_files import LockFile, held_entry
from midair.devices.safety.state_folders import make_state_folder, state_folder
from midair.errors import HeldError


@contextmanager
def device_lock(device: str) -> Generator[None]:
    """While inside, no other program of this user that asks gets the device, nor another part of this one.

    The lock is the system's, on a file of the state folder: it goes with the process, however that ends, and a file
    that was left behind holds nothing up. Windows has no such lock; nobody is refused there.

    Parameters
    ----------
    device : str
        Its name, parts by colons: ``autd3``, which may find any units, holds ``autd3:eth0`` as well, and the reverse.

    Raises
    ------
    HeldError
        If another program has it.
    FileError
        If the state folder cannot be written.
    """
    path = _path(make_state_folder(), device)
    held = LockFile.take(path)
    if held is None:
        raise HeldError(_refusal(device, path))
    try:
        held.write({"device": device})
        # First our own, then a look at the others: of two that come at once at least one sees the other.
        for other in _overlapping(device):
            if held_entry(other) is not None:
                raise HeldError(_refusal(device, other))
        yield
    finally:
        held.let_go()


def _path(folder: Path, device: str) -> Path:
    return folder / f"device-{quote(device, safe='')}.json"


def _overlapping(device: str) -> list[Path]:
    """Files of devices that this one is a part of, or that are a part of it."""
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
