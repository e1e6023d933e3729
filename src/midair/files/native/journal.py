"""Events of a recording and positions of a motion stage: their stored rows, and their steps in the provenance.

Events are lost frames, clipped or constant channels, and clock drift. A file stores them and the positions as rows
along an axis of their own. Readers return them as the steps "events" and "stage" of the provenance, so that copies and
later stages keep them.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, get_args

import numpy as np

from midair.errors import BrokenFileError
from midair.files.native.schema import built_rows
from midair.model import Event, EventKind, Provenance, Setting, StageStamp, speed_of

LISTED = 1000
"""Maximum number of events per kind that are listed in the provenance; the totals count all."""


KINDS: tuple[EventKind, ...] = get_args(EventKind)


def journal_from(values: Mapping[str, Any]) -> tuple[tuple[Event, ...], tuple[StageStamp, ...]]:
    """Events and stage positions from the stored values of a recording; raises BrokenFileError for invalid numbers."""
    events = built_rows(Event, "recording", values, "events")
    stamps = built_rows(StageStamp, "recording", values, "stamps")
    if any(event.frame < 0 or event.frames < 0 for event in events):
        raise BrokenFileError("events: expected frames from 0 on, got others")
    if not np.isfinite([(one.time, *one.position, one.feed) for one in stamps]).all():
        raise BrokenFileError("stage: expected finite times, places and speeds, got others")
    return events, stamps


def with_journal(
    provenance: Provenance, events: Sequence[Event], stamps: Sequence[StageStamp], frames: int, rate: float
) -> Provenance:
    """Add the events and stage positions of a recording of `frames` frames at `rate` (Hz) to its provenance."""
    return with_stage(with_events(provenance, events, frames), stamps, events, rate)


def with_events(provenance: Provenance, events: Iterable[Event], frames: int) -> Provenance:
    """Add the events within `frames` frames to the provenance as step "events", if there are any."""
    # The journal is flushed before the samples, so that events of an interrupted recording may lie beyond its end.
    inside = tuple(event for event in events if event.frame < frames)
    settings = _settings(inside, frames)
    return provenance.then("events", settings) if inside and settings != provenance.last("events") else provenance


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
    return provenance if settings == provenance.last("stage") else provenance.then("stage", settings)
