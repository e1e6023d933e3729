"""Thermometers of the room, and the one that another program writes to a file."""

import re
import time
from abc import ABC, abstractmethod
from datetime import UTC, datetime
from pathlib import Path

from midair.errors import DeviceError

COLDEST, HOTTEST = -10.0, 50.0
"""Range of a plausible room temperature, in degrees Celsius; values in K or F are outside it."""

LINE = re.compile(r"\s*([-+]?\d+(?:\.\d+)?)\s*(?:°?\s*C)?\s*")
"""A temperature in degrees Celsius as text."""


class Thermometer(ABC):
    """A thermometer that is opened by its first `read`; `place` is the part of its name after the kind."""

    kind: str
    stale: float = 10.0
    """Age in s above which a value is an error."""

    def __init__(self, place: str) -> None:
        self.place = place

    @property
    def name(self) -> str:
        """Name as it is typed, such as ``lsl:Room``."""
        return f"{self.kind}:{self.place}"

    def read(self) -> float:
        """Temperature in degrees Celsius.

        Raises DeviceError if it cannot be read, the value is too old, or outside -10 to 50 degrees.
        """
        value, age = self.latest()
        if age > self.stale:
            raise DeviceError(
                f"{self.name}: expected a value of the last {self.stale:g} s, got one of {age:.0f} s ago; check that "
                "the thermometer still sends"
            )
        if not COLDEST <= value <= HOTTEST:
            raise DeviceError(
                f"{self.name}: expected {COLDEST:g} to {HOTTEST:g} degrees Celsius, got {value:g}; check its unit"
            )
        return value

    @abstractmethod
    def latest(self) -> tuple[float, float]:
        """The latest value, and its age in s; waits up to `stale` s for the first one. DeviceError without one."""

    def close(self) -> None:  # noqa: B027  # a file needs no closing
        """Release the thermometer."""


class FileThermometer(Thermometer):
    """Kind ``file:PATH``: the last line of a text file is the temperature, such as ``22.4`` or ``22.4 C``."""

    kind = "file"
    stale = 60.0

    def latest(self) -> tuple[float, float]:
        """Value of the last line, and the time since the file was written."""
        path, last = Path(self.place), ""
        try:
            # The program that writes may just have emptied the file.
            for wait in (0.05, 0.2, 0.0):
                text = path.read_text(encoding="utf-8", errors="replace")
                age = datetime.now(UTC).timestamp() - path.stat().st_mtime
                last = text.strip().rpartition("\n")[2]
                if (found := LINE.fullmatch(last)) is not None:
                    return float(found[1]), age
                time.sleep(wait)
        except OSError as wrong:
            raise DeviceError(
                f"{self.name}: expected a readable file, got: {wrong.strerror}; check the path"
            ) from wrong
        raise DeviceError(
            f"{self.name}: expected a temperature in degrees Celsius in the last line, such as 22.4, got {last[:40]!r}"
        )
