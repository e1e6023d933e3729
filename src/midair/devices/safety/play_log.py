"""What was played, when, how loud, and who answered for it: one line of JSON a time, never rewritten."""

import json
from datetime import UTC, datetime
from pathlib import Path

from midair.devices.admission import Admission
from midair.devices.interface import PlayReport
from midair.devices.safety.state_folders import make_state_folder
from midair.errors import FileError


def log_order(source: str, device: str, admission: Admission) -> Path:
    """Write down what is about to be played, before any sound; the log's path."""
    found = admission.exposure
    return _append(
        {
            "event": "play",
            "drive": source,
            "device": device,
            "frames": None if admission.drive is None else admission.drive.frames,
            "rate_hz": found.rate,
            "repeats": admission.repeats,
            "profile": found.profile.name,
            "exposure": admission.outcome,
            "override_by": admission.by,
            "excess_db": round(found.excess, 2),
            "places": {
                place.name: {"peak_db": round(float(peak), 2), "mean_db": round(float(mean), 2)}
                for place, peak, mean in zip(found.profile.places, found.peak, found.mean, strict=True)
            },
        }
    )


def log_end(source: str, device: str, report: PlayReport | None, reason: str) -> Path:
    """Write down how playing ended; the log's path."""
    entry: dict[str, object] = {"event": "end", "drive": source, "device": device, "reason": reason}
    if report is not None:
        entry |= {"frames": report.frames, "late": report.late, "gap_s": report.gap, "start_ns": report.start}
    return _append(entry)


def _append(entry: dict[str, object]) -> Path:
    path = make_state_folder() / "played.jsonl"
    line = json.dumps({"time": datetime.now(UTC).isoformat(timespec="milliseconds"), **entry})
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
    except OSError as wrong:
        raise FileError(f"{path}: {wrong.strerror}; nothing plays without a log, set MIDAIR_STATE") from wrong
    return path
