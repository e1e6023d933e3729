"""Messages of Grbl 1.1: status reports, alarms and errors; and flow control of its receive buffer.

Source of the protocol: gnea/grbl, doc/markdown, interface.md and commands.md.
"""

import tomllib
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from midair.errors import DeviceError
from midair.model import Place

RECEIVES = 128
"""Bytes of Grbl's receive buffer; it drops the excess without an error."""

GREETINGS = ("Grbl ", "GrblHAL ")
"""Begin of the line that Grbl and grblHAL send after a reset."""

_STORED = tomllib.loads(Path(__file__).with_name("grbl_messages.toml").read_text(encoding="utf-8"))
MEANINGS: Mapping[str, str] = _STORED["alarms_and_errors"]
STATES: Mapping[str, str] = _STORED["states"]
"""Explanations of the machine's states other than Idle and Alarm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusReport:
    """Contents of a status report."""

    state: str
    """For example Idle, Run or Hold:0."""
    position: Place
    """x, y, z in the unit of the report (mm or inches), in machine or work coordinates."""
    work: bool
    """True if the position is in work coordinates."""
    offset: Place | None
    """Machine position minus work position, if reported."""
    feed: float
    """Speed, per minute."""
    pins: str
    """Active inputs, one letter each."""


def parse_status(line: str) -> StatusReport | None:
    """Parse a status report; None for any other, incomplete or damaged line."""
    if not (line.startswith("<") and line.endswith(">")):
        return None
    state, *rest = line[1:-1].split("|")
    if state.partition(":")[0] not in ("Idle", "Alarm", *STATES):
        return None
    fields = dict(part.split(":", 1) for part in rest if ":" in part)
    try:
        work = "WPos" in fields
        return StatusReport(
            state=state,
            position=_parse_position(fields["WPos" if work else "MPos"]),
            work=work,
            offset=_parse_position(fields["WCO"]) if "WCO" in fields else None,
            feed=float((fields.get("FS") or fields.get("F") or "0").split(",")[0]),
            pins=fields.get("Pn", ""),
        )
    except (KeyError, ValueError):
        return None


def with_meaning(line: str) -> str:
    """An alarm or error with its meaning, such as "ALARM:1, a limit switch was hit"."""
    return f"{line}, {MEANINGS[line]}" if line in MEANINGS else line


class Outbox:
    """Lines being sent, with character counting: a line is sent only when Grbl's buffer has room for it."""

    def __init__(self) -> None:
        self._waiting: deque[str] = deque()
        self._sent: deque[str] = deque()

    @property
    def empty(self) -> bool:
        """True if every line was answered."""
        return not (self._waiting or self._sent)

    @property
    def first(self) -> str:
        """The line whose answer comes next; empty if every line was answered."""
        return next(iter((*self._sent, *self._waiting)), "")

    def add(self, line: str) -> None:
        """Queue a line, without its end."""
        self._waiting.append(line)

    def due(self) -> bytes:
        """Lines that can be sent now."""
        data = b""
        while self._waiting and sum(len(line) + 1 for line in (*self._sent, self._waiting[0])) < RECEIVES:
            self._sent.append(self._waiting.popleft())
            data += f"{self._sent[-1]}\n".encode()
        return data

    def answered(self) -> str:
        """The line that an ``ok`` or ``error`` answers; DeviceError if there is none, since the count is then wrong."""
        if not self._sent:
            raise DeviceError("received an answer to a line that was not sent; close other programs that use the port")
        return self._sent.popleft()

    def clear(self) -> None:
        """Drop all lines, after a reset of Grbl."""
        self._waiting.clear()
        self._sent.clear()


def _parse_position(text: str) -> Place:
    x, y, z = (float(part) for part in text.split(",")[:3])
    return x, y, z
