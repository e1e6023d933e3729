"""Event markers for other recorders: a string stream of the Lab Streaming Layer, and bytes on a serial line."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime
from typing import Any, Literal, Self

from midair.errors import DeviceError
from midair.registry import load_object
from midair.study.design.study_design import MarkerOutputs

MarkerKind = Literal["trial", "stimulus", "answer", "late"]
"""Start of a trial; start of a stimulus; an answer; the time limit of a question."""

CODES: dict[MarkerKind, int] = {"trial": 1, "stimulus": 2, "answer": 3, "late": 4}
"""Byte of each kind; a stimulus may have its own (`Stimulus.code`)."""


class EventMarkers:
    """Open marker outputs; a context manager.

    Sent markers are collected until `take` returns them for the log, so that writing to disk delays no marker.
    """

    def __init__(self, outputs: MarkerOutputs) -> None:
        self.outputs = outputs
        self.port: Any = None
        """Open serial port; None without one."""
        self._outlet: Any = None
        self._clock: Callable[[], float] = time.monotonic
        self._hold = ExitStack()
        self._sent: list[dict[str, Any]] = []
        self._trial = ""

    def __enter__(self) -> Self:
        with ExitStack() as hold:
            if self.outputs.serial:
                self.port = hold.enter_context(_serial_port(self.outputs.serial, self.outputs.baud))
            if self.outputs.lsl:
                pylsl = load_object("markers", "pylsl [lsl]")
                name = self.outputs.lsl
                self._outlet = pylsl.StreamOutlet(
                    pylsl.StreamInfo(name, "Markers", 1, pylsl.IRREGULAR_RATE, pylsl.cf_string, f"midair {name}")
                )
                self._clock = pylsl.local_clock
            self._hold = hold.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._outlet = None
        self._hold.close()

    def send(self, kind: MarkerKind, trial: str = "", *, code: int = 0) -> None:
        """Send one marker; raises DeviceError if the serial port does not accept it.

        `trial` is the code of the trial, that of the last marker if empty; `code` replaces the byte of the kind.
        """
        self._trial = trial or self._trial
        byte = code or CODES[kind]
        at = self._clock()
        if self._outlet is not None:
            self._outlet.push_sample([f"{byte} {kind} {self._trial}"], at)
        if self.port is not None:
            try:
                self.port.write(bytes([byte]))
            except OSError as wrong:
                raise DeviceError(
                    f"markers: expected {self.outputs.serial} to accept a byte, got: {wrong}; connect it again"
                ) from wrong
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        self._sent.append({"kind": kind, "trial": self._trial, "code": byte, "clock_s": round(at, 6), "time": now})

    def take(self) -> list[dict[str, Any]]:
        """Return the markers sent since the last call."""
        sent, self._sent = self._sent, []
        return sent


def _serial_port(name: str, baud: int) -> Any:
    serial = load_object("markers", "serial [serial]")
    try:
        return serial.Serial(name, baud, timeout=1, write_timeout=1, exclusive=True)
    except (OSError, ValueError) as wrong:
        raise DeviceError(
            f"markers: expected the serial port {name}, got: {wrong}; connect it, or name another with --serial"
        ) from wrong
