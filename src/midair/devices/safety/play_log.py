"""The log of playback: time, drive, exposure and outcome, one line of JSON per event, append-only."""

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from midair.devices.exposure_check import ExposureClearance
from midair.devices.safety.lock_files import (
    LockFile,
    append_line,
    command,
    make_state_folder,
    state_folder,
    token,
    user,
)
from midair.devices.safety.stop_channel import playing_now
from midair.errors import ExposureError, FileError
from midair.model import Drive, Medium
from midair.physics import ExposureProfile
from midair.streaming import blocks
from midair.version import __version__

LOG = "played.jsonl"
"""Name of the file in the state folder."""

Ending = Literal["played", "stopped", "failed"]
"""Played to the end; stopped by the user; ended by an error."""


def log_order(
    source: str | Path,
    device: str,
    clearance: ExposureClearance,
    *,
    simulated: bool = False,
    room: Medium | None = None,
    participant: str = "",
) -> str:
    """Log a drive before it is played; return the number of the order, for `log_end`.

    A `source` that is a Path is hashed; orders of programs that died are closed first. Raises FileError if the log or
    the drive's file cannot be used, since nothing plays without a log; ExposureError if the participant, or all who are
    not named, would be exposed for more hours today (UTC) than the profile permits, without an override.
    """
    close_orders()
    longer = "" if simulated else _check_hours(clearance, participant)
    found, order = clearance.exposure, token()
    # A drive that is still being solved and checked is described when the order ends.
    known: dict[str, object] = {"exposure": clearance.outcome, "override_by": clearance.by}
    _append(
        {
            "event": "play",
            "order": order,
            "version": __version__,
            "user": user(),
            "process": os.getpid(),
            "command": command(),
            "participant": participant,
            "device": device,
            "simulated": simulated,
            "drive": str(source),
            "file_sha256": _hash_of_file(source) if isinstance(source, Path) else None,
            "rate_hz": found.rate,
            "repeats": found.repeats,
            "room": None if room is None else {"temperature_c": room.temperature, "humidity": room.humidity},
            "profile": found.profile.name,
            "profile_sha256": hash_of_profile(found.profile),
        }
        | (known if clearance.later else exposed(clearance))
        | ({"override_by": longer} if longer else {})
    )
    return order


def _check_hours(clearance: ExposureClearance, participant: str) -> str:
    """Name of the person responsible for more hours than the profile permits; empty if there are no more."""
    profile, drive = clearance.exposure.profile, clearance.drive
    coming = 0.0 if drive is None else drive.frames * clearance.repeats / drive.rate
    if coming <= (left := sound_left(profile, participant)):
        return ""
    if not clearance.named:
        raise hours_error(profile, participant, 3600 * profile.hours - left, coming)
    return clearance.named


def sound_left(profile: ExposureProfile, participant: str) -> float:
    """Time of sound in s that a profile leaves today (UTC) to a participant, or to all who are not named."""
    today = datetime.now(UTC).date().isoformat()
    events = [entry for entry in read_log()[0] if entry["time"].startswith(today)]
    began = {
        entry["order"]: datetime.fromisoformat(entry["time"])
        for entry in events
        if entry["event"] == "play" and not entry.get("simulated") and entry.get("participant", "") == participant
    }
    ends = [entry for entry in events if entry["event"] == "end" and entry["order"] in began]
    took = [(datetime.fromisoformat(end["time"]) - began[end["order"]]).total_seconds() for end in ends]
    return 3600 * profile.hours - sum(float(end.get("duration_s", at)) for end, at in zip(ends, took, strict=True))


def hours_error(profile: ExposureProfile, participant: str, spent: float, coming: float) -> ExposureError:
    """The error for sound of so many seconds today, and more to come, than a profile permits."""
    return ExposureError(
        f"exposure: expected at most {profile.hours:g} h of sound a day for {participant or 'people not named'}, got "
        f"{spent / 3600:.3g} h today and {coming / 3600:.3g} h more, and {profile.name} holds for no longer: go on "
        "tomorrow, or name who is responsible with --override-exposure"
    )


def exposed(clearance: ExposureClearance) -> dict[str, object]:
    """The drive of a clearance and its exposure, for the log."""
    found, drive = clearance.exposure, clearance.drive
    medium = found.airs[-1].medium
    return {
        "sha256": None if drive is None else hash_of_drive(drive),
        "frames": None if drive is None else drive.frames,
        "level": clearance.level if drive is None else max(float(part.max()) for part in blocks(drive.level)),
        "exposure": clearance.outcome,
        "override_by": clearance.by,
        "excess_db": _number(found.excess),
        "palm_pa": found.pressure,
        # Radiation pressure of a plane wave is alpha times its intensity over the speed of sound.
        "palm_w_m2": found.pressure * medium.speed / medium.alpha,
        "palm_warming_k": found.warming,
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


def log_end(
    order: str,
    source: str | Path,
    device: str,
    outcome: Ending,
    reason: str = "",
    *,
    report: Mapping[str, object] | None = None,
) -> None:
    """Log how playback ended; `report` holds the fields of the `PlayReport`, and what was checked while it played."""
    units = {"duration": "duration_s", "start": "start_ns", "gap": "gap_s", "paused": "paused_s"}
    said = {units.get(name, name): value for name, value in (report or {}).items()}
    entry = {"event": "end", "order": order, "drive": str(source), "device": device, "outcome": outcome}
    _append(entry | {"reason": reason or outcome} | said)


def log_pause(order: str, source: str | Path, device: str, event: str, reason: str) -> None:
    """Log that playback paused (event "pause") or goes on (event "continue")."""
    _append({"event": event, "order": order, "drive": str(source), "device": device, "reason": reason})


def close_orders() -> None:
    """Log an end for each order of a program that died, for example by SIGKILL.

    Raises FileError if the log cannot be read or written.
    """
    if not _open_orders():
        return
    held = LockFile.take(make_state_folder() / "closing-orders.json")
    if held is None:  # another program closes them
        return
    try:
        alive = {os.getpid(), *(entry["process"] for entry in playing_now())}
        # Read after `alive`: a program logs its end before it leaves `playing_now`.
        for entry in _open_orders():
            if entry.get("process") not in alive:
                reason = f"ended without a report: process {entry.get('process')} died after {entry.get('time')}"
                log_end(entry["order"], entry.get("drive", ""), entry.get("device", ""), "failed", reason)
    finally:
        held.release()


def _open_orders() -> list[dict[str, Any]]:
    orders: dict[str, dict[str, Any]] = {}
    for entry in read_log()[0]:
        if entry["event"] == "play":
            orders[entry["order"]] = entry
        elif entry["event"] == "end":
            orders.pop(entry["order"], None)
    return list(orders.values())


def read_log() -> tuple[list[dict[str, Any]], int]:
    """All events of the log, and the number of lines that cannot be read, such as one cut off by a power failure.

    Raises FileError if there is a log that cannot be opened.
    """
    path = state_folder() / LOG
    try:
        lines = path.read_bytes().splitlines()
    except FileNotFoundError:
        return [], 0
    except OSError as wrong:
        raise _unusable(path, wrong) from wrong
    events = [entry for line in lines if (entry := _event(line)) is not None]
    return events, len(lines) - len(events)


def _event(line: bytes) -> dict[str, Any] | None:
    try:
        entry = json.loads(line)
        datetime.fromisoformat(entry["time"])
        return entry if isinstance(entry.get("order", ""), str) and isinstance(entry["event"], str) else None
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def hash_of_drive(drive: Drive) -> str:
    """SHA-256, in hex, of all phases and then all levels, as in memory, row by row."""
    digest = hashlib.sha256()
    for part in (drive.phase, drive.level):
        for block in blocks(part):
            digest.update(np.ascontiguousarray(block).view(np.uint8).data)
    return digest.hexdigest()


def hash_of_profile(profile: ExposureProfile) -> str:
    """SHA-256, in hex, of all fields of a profile, as JSON with sorted keys and without spaces."""
    plain = json.dumps(asdict(profile), sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(plain.encode()).hexdigest()


def _hash_of_file(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as wrong:
        raise FileError(f"{path}: expected a readable drive for the log, got {wrong.strerror}") from wrong


def _number(value: float) -> float | None:
    """Round to two decimals; None for infinity (silence in dB), which JSON does not have."""
    return round(float(value), 2) if math.isfinite(value) else None


def _append(entry: dict[str, object]) -> None:
    path = make_state_folder() / LOG
    text = json.dumps({"time": datetime.now(UTC).isoformat(timespec="milliseconds"), **entry}, default=str) + "\n"
    try:
        append_line(path, text.encode())
    except OSError as wrong:
        raise _unusable(path, wrong) from wrong


def _unusable(path: Path, wrong: OSError) -> FileError:
    return FileError(f"{path}: {wrong.strerror}; nothing plays without a log, set MIDAIR_STATE")
