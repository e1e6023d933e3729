"""Event markers that were sent during the sessions of a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

    from midair.study.design.session_state import SessionState


@dataclass(frozen=True, slots=True, kw_only=True)
class SentMarker:
    """One marker of the log."""

    kind: str
    """"trial", "stimulus", "answer" or "late"."""
    trial: str
    """Code of the trial."""
    code: int
    """Byte of the marker."""
    clock_s: float
    """Time on the clock of LSL, in s; the monotonic clock of the computer without an LSL stream."""
    time: str
    """ISO 8601."""


def markers_table(sessions: Sequence[SessionState]) -> DataFrame:
    """Table of all sent markers with the columns of a BIDS table of events, and participant, session and trial."""
    from pandas import DataFrame

    from midair.study.design.answers import seconds_between

    rows: list[dict[str, Any]] = []
    for session in sessions:
        trials = {trial.code: trial for trial in session.trials}
        for marker in session.markers:
            trial = trials[marker.trial]
            rows.append(
                {
                    "participant": f"sub-{trial.participant:02d}",
                    "session": trial.session,
                    "onset": seconds_between(session.began.get(trial.session, marker.time), marker.time),
                    "duration": "n/a",
                    "trial_type": marker.kind,
                    "value": marker.code,
                    "trial": trial.number,
                    "clock": marker.clock_s,
                }
            )
    return DataFrame(rows)
