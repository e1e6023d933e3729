"""Events during a recording: lost frames, clipped or constant channels, clock drift.

A running recording stores them as rows along an axis of their own, because attributes cannot change while other
programs read. Readers return the journal as the step "events" of the provenance, so that copies and later stages keep
it.
"""

from collections.abc import Iterable, Mapping
from typing import Any, get_args

import numpy as np

from midair.errors import BrokenFileError
from midair.model import Event, EventKind, Provenance, Setting

LISTED = 1000
"""Maximum number of events per kind that are listed in the provenance; the totals count all."""


KINDS: tuple[EventKind, ...] = get_args(EventKind)
"""The number in the file is the index in this tuple."""


def event_values(events: Iterable[Event]) -> dict[str, Any]:
    """Stored values of events."""
    rows = tuple(events)
    return {
        "event": np.arange(len(rows)),
        "event_kind": np.array([KINDS.index(row.kind) for row in rows], np.int8),
        "event_frame": np.array([row.frame for row in rows], np.int64),
        "event_frames": np.array([row.frames for row in rows], np.int64),
        "event_channel": np.array([row.channel for row in rows], np.int64),
        "event_ppm": np.array([row.ppm for row in rows], np.float64),
    }


def events_from(values: Mapping[str, Any]) -> tuple[Event, ...]:
    """Events from their stored values, () for a file without a journal; raises BrokenFileError for invalid numbers."""
    if any(f"event_{name}" not in values for name in ("kind", "frame", "frames", "channel", "ppm")):
        return ()
    kind, first, frames = values["event_kind"], values["event_frame"], values["event_frames"]
    if len(kind) and not (0 <= kind.min() <= kind.max() < len(KINDS) and first.min() >= 0 and frames.min() >= 0):
        raise BrokenFileError(f"events: expected kinds 0 to {len(KINDS) - 1} at frames from 0 on, got others")
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
    of = {kind: [event for event in events if event.kind == kind] for kind in KINDS}
    settings: dict[str, Setting] = {}
    for kind in ("lost", "late"):
        if of[kind]:
            runs = [(event.frame, min(event.frames, frames - event.frame)) for event in of[kind]]
            settings |= {f"{kind}_frames": sum(count for _, count in runs), kind: tuple(runs[:LISTED])}
    if of["clipped"]:
        settings["clipped_frames"] = sum(event.frames for event in of["clipped"])
        settings["clipped"] = tuple((event.channel, event.frame, event.frames) for event in of["clipped"][:LISTED])
    if of["mended"]:
        settings["mended_frames"] = sum(event.frames for event in of["mended"])
        settings["mended"] = tuple((event.channel, event.frame, event.frames) for event in of["mended"][:LISTED])
    for kind in ("dead", "stuck"):
        if of[kind]:
            settings[kind] = tuple((event.channel, event.frame) for event in of[kind][:LISTED])
    for kind in ("rate", "clock"):
        if of[kind]:
            settings[f"{kind}_ppm"] = of[kind][-1].ppm
    if of["trigger"]:
        settings["trigger"] = of["trigger"][0].frame
    if of["stroke"]:
        settings["strokes"] = tuple((row.frame, min(row.frames, frames - row.frame)) for row in of["stroke"][:LISTED])
    return settings
