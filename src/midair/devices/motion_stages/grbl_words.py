"""What Grbl 1.1 says, read: status reports, alarms, refusals; and how much it can be told at once.

Source of the protocol: gnea/grbl, doc/markdown, interface.md and commands.md.
"""

from collections import deque
from dataclasses import dataclass

from midair.errors import DeviceError
from midair.model import Place

RECEIVES = 128
"""Bytes of Grbl's receive buffer; what does not fit is lost without a word."""

MEANINGS = {
    "ALARM:1": "a limit switch was hit, its place is probably lost",
    "ALARM:2": "it was to go beyond its own travel, its place is kept",
    "ALARM:3": "it was reset while it moved, its place is probably lost",
    "ALARM:6": "it was reset while it looked for its switches",
    "ALARM:7": "its door was opened while it looked for its switches",
    "ALARM:8": "it did not get off a limit switch",
    "ALARM:9": "it found no limit switch",
    "error:5": "it has no limit switches to find ($22=0)",
    "error:8": "it is busy",
    "error:9": "it is locked",
    "error:11": "the line is too long for it",
    "error:15": "that is beyond its own travel",
    "error:20": "it does not know that command",
    "error:22": "it knows no speed",
}
STATES = {
    "Run": "it moves already",
    "Jog": "it moves already",
    "Home": "it looks for its switches",
    "Hold": "somebody held it",
    "Door": "its door is open",
    "Check": "it only checks programs ($C)",
    "Sleep": "it sleeps ($SLP)",
}
"""What a state of the machine means, other than Idle and Alarm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusReport:
    """What stands between the chevrons of a report.

    Attributes
    ----------
    state : str
        Such as Idle, Run or Hold:0.
    position : tuple of float
        x, y, z in the numbers of the report (mm or inches): the machine's, or the work's where `offset` is missing.
    work : bool
        Whether it is the work's.
    offset : tuple of float or None
        The machine's place less the work's, in reports that have it.
    feed : float
        Speed, per minute.
    pins : str
        Inputs that are triggered, a letter each.
    """

    state: str
    position: Place
    work: bool
    offset: Place | None
    feed: float
    pins: str


def status_of(line: str) -> StatusReport | None:
    """The report of a line; None if it is none, or one that was cut."""
    if not (line.startswith("<") and line.endswith(">")):
        return None
    state, *rest = line[1:-1].split("|")
    fields = dict(part.split(":", 1) for part in rest if ":" in part)
    try:
        work = "WPos" in fields
        return StatusReport(
            state=state,
            position=_three(fields["WPos" if work else "MPos"]),
            work=work,
            offset=_three(fields["WCO"]) if "WCO" in fields else None,
            feed=float((fields.get("FS") or fields.get("F") or "0").split(",")[0]),
            pins=fields.get("Pn", ""),
        )
    except (KeyError, ValueError):
        return None


def in_words(line: str) -> str:
    """An alarm or a refusal with what it means, such as "ALARM:1, a limit switch was hit"."""
    return f"{line}, {MEANINGS[line]}" if line in MEANINGS else line


class Outbox:
    """Lines on their way, counted by character: none is sent before Grbl has room for it, each is answered in turn."""

    def __init__(self) -> None:
        self._waiting: deque[str] = deque()
        self._sent: deque[str] = deque()

    @property
    def empty(self) -> bool:
        """Whether every line was answered."""
        return not (self._waiting or self._sent)

    def add(self, line: str) -> None:
        """A line to send, without its end."""
        self._waiting.append(line)

    def due(self) -> bytes:
        """What can be sent now."""
        data = b""
        while self._waiting and self._taken() + len(self._waiting[0]) + 1 < RECEIVES:
            self._sent.append(self._waiting.popleft())
            data += f"{self._sent[-1]}\n".encode()
        return data

    def answered(self) -> str:
        """The line that an ``ok`` or ``error`` is about.

        Raises
        ------
        DeviceError
            If there was none: the count is wrong, and nothing that follows is certain.
        """
        if not self._sent:
            raise DeviceError("an answer came to a line that was not sent; does another program use the port?")
        return self._sent.popleft()

    def forget(self) -> None:
        """Grbl was reset: what was on its way is gone."""
        self._waiting.clear()
        self._sent.clear()

    def _taken(self) -> int:
        return sum(len(line) + 1 for line in self._sent)


def _three(text: str) -> Place:
    x, y, z = (float(part) for part in text.split(",")[:3])
    return x, y, z
