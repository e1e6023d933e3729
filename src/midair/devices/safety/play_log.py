"""What was played, when, how loud, and who answered for it: one line of JSON a time, never rewritten."""

import errno
import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np

from midair.devices.exposure_check import ExposureClearance
from midair.devices.safety.lock_files import command, token, user
from midair.devices.safety.state_folders import make_state_folder
from midair.errors import FileError
from midair.lazy_frames import blocks
from midair.model import Drive, Medium
from midair.physics import ExposureProfile
from midair.version import __version__

LOG = "played.jsonl"
"""Name of the file in the state folder."""

Ending = Literal["played", "stopped", "failed"]
"""To its end; ended by somebody; ended by an error."""


def log_order(
    source: str | Path,
    device: str,
    admission: ExposureClearance,
    *,
    simulated: bool = False,
    room: Medium | None = None,
) -> str:
    """Write down what is about to be played, before any sound.

    Parameters
    ----------
    source : str or Path
        The drive's file, which is hashed; or a word for where it came from.
    device : str
        Name of the array.
    admission : Admission
        Of the drive, on this array.
    simulated : bool
        Whether the array is an emulator.
    room : Medium, optional
        The air in which it plays, if somebody stated it.

    Returns
    -------
    str
        Names this order in `log_end`.

    Raises
    ------
    FileError
        If the log, or the drive's file, cannot be used: nothing plays without a log.
    """
    found, drive, order = admission.exposure, admission.drive, token()
    _append(
        {
            "event": "play",
            "order": order,
            "version": __version__,
            "user": user(),
            "process": os.getpid(),
            "command": command(),
            "device": device,
            "simulated": simulated,
            "drive": str(source),
            "file_sha256": _hash_of_file(source) if isinstance(source, Path) else None,
            "sha256": None if drive is None else hash_of_drive(drive),
            "frames": None if drive is None else drive.frames,
            "rate_hz": found.rate,
            "repeats": admission.repeats,
            "room": None if room is None else {"temperature_c": room.temperature, "humidity": room.humidity},
            "profile": found.profile.name,
            "profile_sha256": hash_of_profile(found.profile),
            "exposure": admission.outcome,
            "override_by": admission.by,
            "excess_db": _number(found.excess),
            "places": {
                place.name: {
                    "peak_db": _number(peak),
                    "mean_db": _number(mean),
                    "limit_db": place.limit,
                    "enforced": place.enforced,
                }
                for place, peak, mean in zip(found.profile.places, found.peak, found.mean, strict=True)
            },
        }
    )
    return order


def log_end(
    order: str,
    source: str | Path,
    device: str,
    outcome: Ending,
    reason: str = "",
    *,
    report: Mapping[str, object] | None = None,
) -> None:
    """Write down how playing ended.

    Parameters
    ----------
    order : str
        From `log_order`.
    source, device
        As there.
    outcome : {"played", "stopped", "failed"}
        How it ended.
    reason : str
        The error, if there was one.
    report : mapping, optional
        What the array said, by name.
    """
    units = {"duration": "duration_s", "start": "start_ns", "gap": "gap_s"}
    said = {units.get(name, name): value for name, value in (report or {}).items()}
    entry = {"event": "end", "order": order, "drive": str(source), "device": device, "outcome": outcome}
    _append(entry | {"reason": reason or outcome} | said)


def hash_of_drive(drive: Drive) -> str:
    """SHA-256, in hex, of all phases and then all levels, as the drive holds them in memory, row by row."""
    digest = hashlib.sha256()
    for part in (drive.phase, drive.level):
        for block in blocks(part):
            digest.update(np.ascontiguousarray(block).view(np.uint8).data)
    return digest.hexdigest()


def hash_of_profile(profile: ExposureProfile) -> str:
    """SHA-256, in hex, of everything that a profile says, as JSON with sorted keys and no spaces."""
    plain = json.dumps(asdict(profile), sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(plain.encode()).hexdigest()


def _hash_of_file(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as wrong:
        raise FileError(f"{path}: expected a drive to note in the log, got {wrong.strerror}") from wrong


def _number(value: float) -> float | None:
    """To two places; JSON has no infinity, the level of silence."""
    return round(float(value), 2) if math.isfinite(value) else None


def _append(entry: dict[str, object]) -> None:
    path = make_state_folder() / LOG
    text = json.dumps({"time": datetime.now(UTC).isoformat(timespec="milliseconds"), **entry}, default=str) + "\n"
    line = text.encode()
    try:
        # In one piece, so that two programs that write at once do not mix their lines; for this user only.
        handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        try:
            if (taken := os.write(handle, line)) < len(line):
                # A disk that fills up takes a part and raises nothing.
                os.ftruncate(handle, os.lseek(handle, 0, os.SEEK_CUR) - taken)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as wrong:
        raise FileError(f"{path}: {wrong.strerror}; nothing plays without a log, set MIDAIR_STATE") from wrong
