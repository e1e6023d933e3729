"""Events of a recording and positions of a motion stage: their stored rows, and their steps in the provenance.

Events are lost frames, clipped or constant channels, and clock drift. A file stores them and the positions as rows
along an axis of their own. Readers return them as the steps "events" and "stage" of the provenance, so that copies and
later stages keep them.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, get_args

import numpy as np

from midair.errors import BrokenFileError
from midair.model import Event, EventKind, Provenance, Setting, StageStamp, speed_of

LISTED = 1000
"""Maximum number of events per kind that are listed in the provenance; the totals count all."""


KINDS: tuple[EventKind, ...] = get_args(EventKind)
"""The number in the file is the index in this tuple."""


def event_values(events: Iterable[Event]) -> dict[str, Any]:
    """Stored values of events, {} for none."""
    rows = tuple(events)
    if not rows:
        return {}
    whole = {f"event_{name}": [getattr(row, name) for row in rows] for name in ("frame", "frames", "channel")}
    return {
        "event_kind": np.array([KINDS.index(row.kind) for row in rows], np.int8),
        **{name: np.array(values, np.int64) for name, values in whole.items()},
        "event_ppm": np.array([row.ppm for row in rows], np.float64),
    }


def events_from(values: Mapping[str, Any]) -> tuple[Event, ...]:
    """Events from their stored values, () for a file without a journal; raises BrokenFileError for invalid numbers."""
    if any(f"event_{name}" not in values for name in ("kind", "frame", "frames", "channel", "ppm")):
        return ()
    kind, first, frames = values["event_kind"], values["event_frame"], values["event_frames"]
    if len(kind) and (first.min() < 0 or frames.min() < 0):
        raise BrokenFileError("events: expected frames from 0 on, got others")
    columns = zip(kind, first, frames, values["event_channel"], values["event_ppm"], strict=True)
    return tuple(
        Event(kind=KINDS[int(k)], frame=int(f), frames=int(n), channel=int(c), ppm=float(p))
        for k, f, n, c, p in columns
    )


def with_events(provenance: Provenance, events: Iterable[Event], frames: int) -> Provenance:
    """Add the events within `frames` frames to the provenance as step "events", if there are any."""
    # The journal is flushed before the samples, so that events of an interrupted recording may lie beyond its end.
    inside = tuple(event for event in events if event.frame < frames)
    return provenance.then("events", _settings(inside, frames)) if inside else provenance


def _settings(events: tuple[Event, ...], frames: int) -> dict[str, Setting]:
    settings: dict[str, Setting] = {}
    for kind in KINDS:
        rows = [event for event in events if event.kind == kind]
        runs = [(row.frame, min(row.frames, frames - row.frame)) for row in rows]
        if not rows:
            continue
        if kind in ("rate", "clock"):
            settings[f"{kind}_ppm"] = rows[-1].ppm
        elif kind == "trigger":
            settings["trigger"] = rows[0].frame
        elif kind == "stroke":
            settings["strokes"] = tuple(runs[:LISTED])
        elif kind in ("lost", "late"):
            settings |= {f"{kind}_frames": sum(count for _, count in runs), kind: tuple(runs[:LISTED])}
        elif kind in ("clipped", "mended"):
            settings[f"{kind}_frames"] = sum(row.frames for row in rows)
            settings[kind] = tuple((row.channel, row.frame, row.frames) for row in rows[:LISTED])
        else:
            settings[kind] = tuple((row.channel, row.frame) for row in rows[:LISTED])
    return settings


LISTED_STAMPS = 2000
"""Maximum number of positions in the provenance: 200 s of strokes at ten per second."""

COLUMNS = ("stage_time", "stage_x", "stage_y", "stage_z", "stage_feed")


def stage_values(stamps: Iterable[StageStamp]) -> dict[str, Any]:
    """Stored values of stage positions, {} for none."""
    table = np.array([(stamp.time, *stamp.position, stamp.feed) for stamp in stamps], np.float64).reshape(-1, 5)
    return dict(zip(COLUMNS, table.T, strict=True)) if len(table) else {}


def stamps_from(values: Mapping[str, Any]) -> tuple[StageStamp, ...]:
    """Stage positions from their stored values, () for a file without a stage; raises BrokenFileError if not finite."""
    if any(name not in values for name in COLUMNS):
        return ()
    table = np.column_stack([values[name] for name in COLUMNS])
    if not np.isfinite(table).all():
        raise BrokenFileError("stage: expected finite times, places and speeds, got others")
    return tuple(StageStamp(time=t, position=(x, y, z), feed=feed) for t, x, y, z, feed in table.tolist())


def with_stage(
    provenance: Provenance, stamps: Sequence[StageStamp], events: Iterable[Event], rate: float
) -> Provenance:
    """Add the stage positions of a recording at `rate` (Hz) to the provenance as step "stage", if there are any."""
    if not stamps:
        return provenance
    strokes = [event for event in events if event.kind == "stroke"]
    speeds = [
        speed_of([one for one in stamps if event.frame <= one.time * rate <= event.frame + event.frames])
        for event in strokes
    ]
    settings: dict[str, Setting] = {
        "strokes": len(strokes),
        "speed_m_s": tuple(speeds),
        "columns": ("time_s", "x_m", "y_m", "z_m", "feed_m_s"),
        "stamps": tuple((one.time, *one.position, one.feed) for one in stamps[:LISTED_STAMPS]),
    }
    return provenance.then("stage", settings)
