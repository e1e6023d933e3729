"""Positions of a motion stage during a recording: rows in the file, and a step of its provenance.

As with the journal (`events`), rows can be added while other programs read. Readers return them as the step "stage" of
the provenance, so that copies and later steps keep them.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from midair.errors import BrokenFileError
from midair.model import Event, Provenance, Setting, StageStamp, speed_of

LISTED_STAMPS = 2000
"""Maximum number of positions in the provenance: 200 s of strokes at ten per second."""

COLUMNS = ("stage_time", "stage_x", "stage_y", "stage_z", "stage_feed")


def stage_values(stamps: Iterable[StageStamp]) -> dict[str, Any]:
    """Stored values of stage positions."""
    table = np.array([(stamp.time, *stamp.position, stamp.feed) for stamp in stamps], np.float64).reshape(-1, 5)
    return {"stage": np.arange(len(table)), **dict(zip(COLUMNS, table.T, strict=True))}


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
    speeds = [speed_of([one for one in stamps if _during(one, event, rate)]) for event in strokes]
    settings: dict[str, Setting] = {
        "strokes": len(strokes),
        "speed_m_s": tuple(speeds),
        "columns": ("time_s", "x_m", "y_m", "z_m", "feed_m_s"),
        "stamps": tuple((one.time, *one.position, one.feed) for one in stamps[:LISTED_STAMPS]),
    }
    return provenance.then("stage", settings)


def _during(stamp: StageStamp, stroke: Event, rate: float) -> bool:
    return stroke.frame <= stamp.time * rate <= stroke.frame + stroke.frames
