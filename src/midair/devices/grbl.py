"""A motion stage with Grbl 1.1 or grblHAL, such as a small milling machine; needs the extra `serial`.

One line is sent at a time, so that the machine stops at the end of its move if the connection or the program ends.
Protocol: gnea/grbl, doc/markdown, interface.md and commands.md.
"""

import os
import re
import time
import tomllib
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from midair.devices.safety.stop_guard import device_lock
from midair.errors import DeviceError, InputError, LinkLostError
from midair.model import Place, StageStamp
from midair.registry import load_object

QUERY_INTERVAL = 0.1
"""Seconds between two status queries; Grbl's makers advise against more than ten per second."""
ANSWER, HOMING = 2.0, 120.0
"""Time limits in s: for an answer, of a move after it was last reported to run; for homing, without any answer."""
HOLD, RESET, QUERY = b"!", b"\x18", b"?"
GREETINGS = ("Grbl ", "GrblHAL ")
"""Begin of the line that Grbl and grblHAL send after a reset."""

_STORED = tomllib.loads(Path(__file__).with_name("grbl_messages.toml").read_text(encoding="utf-8"))
STATES: Mapping[str, str] = _STORED["states"]
"""Explanations of the machine's states other than Idle and Alarm."""

_NUMBER = r"(-?\d+\.?\d*)"
REPORT = re.compile(
    rf"<((?:{'|'.join(('Idle', 'Alarm', *STATES))})(?::\d)?)\|MPos:{_NUMBER},{_NUMBER},{_NUMBER}(?:,[-.\d]+)*(\|.*)?>"
)
"""State, x, y, z in machine coordinates, and the other fields of a status report."""


class GrblStage:
    """A machine with three axes on `port`, such as ``/dev/ttyUSB0`` or ``COM3``.

    `search` limits the time to the first answer, in s: opening the port restarts many boards. DeviceError if the
    machine reports an alarm, rejects a line or restarts; LinkLostError if it does not answer.
    """

    def __init__(self, port: str, *, baud: int = 115_200, search: float = 5.0) -> None:
        self.name, self.firmware = f"grbl:{port}", "Grbl"
        self.stands = "an unknown position"
        """Last position that was reported, in words."""
        self._address, self._baud, self._search = port, baud, search
        self._serial: Any = load_object("grbl", "serial:Serial [serial]")
        self._resources = ExitStack()
        self._port: Any = None
        self._line, self._received, self._locked = "", b"", False
        # None while it starts: greetings are expected then.
        self._report: tuple[str, StageStamp, str] | None = None
        self._asked = self._reported = -np.inf
        self._settings: dict[int, float] = {}

    def __enter__(self) -> Self:
        """Open the port and wait for the first status report; nothing moves."""
        with ExitStack() as hold:
            # The real path, since one port has several names; a sensor on the same port is refused as well.
            hold.enter_context(device_lock(f"serial:{os.path.realpath(self._address)}"))
            only = {"exclusive": True} if os.name == "posix" else {}
            try:
                self._port = self._serial(self._address, self._baud, timeout=0.01, write_timeout=1.0, **only)
            except (OSError, ValueError) as wrong:
                raise self._wrong(f"expected a port, got: {wrong}; see midair doctor") from wrong
            hold.callback(self._port.close)
            self._start()
            self._resources = hold.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._resources.close()

    def ready(self, *, homing: bool) -> StageStamp:
        """Return the position if the machine is at rest, not locked, and knows its position.

        `homing` is whether limit switches are required. Raises DeviceError with advice if it is not ready.
        """
        state, _, fields = self._query()
        if state == "Alarm":
            raise self._wrong(
                "it is locked (Alarm) and its position is unknown; remove all obstacles, then home it: --home"
            )
        if state != "Idle":
            raise self._wrong(f"expected a machine at rest (Idle), got {state}: {STATES[state.partition(':')[0]]}")
        self._send("$$")
        self._send("$I")
        pressed = ", ".join(sorted(set("XYZ").intersection("".join(re.findall(r"\|Pn:(\w+)", fields)))))
        for wrong, words in (
            (not self.firmware.startswith("Grbl 1.1"), f"expected Grbl 1.1, got {self.firmware}"),
            (self._settings.get(13), "expected reports in mm, got inches; set $13=0"),
            (pressed, f"a limit switch is pressed ({pressed}); move it off by hand"),
            (
                homing and not self._settings.get(22),
                "it has no limit switches ($22=0), so that 0 is the position at power-on; if you set that position "
                'by hand each time, write homing = "by hand" into the stage\'s file',
            ),
        ):
            if wrong:
                raise self._wrong(words)
        return self._query()[1]

    def home(self, stopped: Callable[[], bool]) -> None:
        """Find the limit switches ($H); the machine moves, and does not answer until it has found them."""
        if (state := self._query()[0]) not in ("Idle", "Alarm"):
            raise self._wrong(f"expected a machine at rest, got {state}")
        homed = None
        try:
            homed = self._send("$H", HOMING, stopped)
        finally:
            if homed is None:
                # During homing Grbl ignores a hold, but not a reset.
                self._line = ""
                with suppress(DeviceError):
                    self._io(lambda port: port.write(RESET))
        if homed is None:
            raise self._wrong("stopped during homing; its position is unknown, home it again")
        self._locked = False

    def check_speed(self, speed: float, way: float, axis: int) -> None:
        """Raise InputError unless it reaches a speed (m/s) and keeps it over at least half of a way (m) along an axis.

        Speeding up and slowing down take speed**2 / acceleration together.
        """
        # Grbl's units: mm/min and mm/s2.
        largest, growth = (self._settings.get(number + axis, 0.0) for number in (110, 120))
        if 60e3 * speed > largest:
            raise InputError(
                f"--speed: expected up to {largest / 60:g} mm/s, the machine's own limit along the stroke, got "
                f"{1e3 * speed:g} mm/s; choose a lower speed"
            )
        if 2e3 * speed**2 > growth * way:
            raise InputError(
                f"--speed: {1e3 * speed:g} mm/s is reached over less than half of {1e3 * way:g} mm, with speeding up "
                f"at {growth:g} mm/s2 and slowing down; make the stroke longer or slower"
            )

    def move(
        self, target: Place, speed: float, *, stamp: Callable[[StageStamp], object], stopped: Callable[[], bool]
    ) -> tuple[float, float] | None:
        """Move in a straight line to x, y, z in machine coordinates (m) at `speed` (m/s), and return on arrival.

        `stamp` is called with every position that the machine reports; `stopped` is called continuously. If the move
        ends early, also by an error, the machine brakes and cancels the rest of it. Returns start and end time on this
        computer's monotonic clock, or None if it was stopped.
        """
        x, y, z = (1e3 * part for part in target)
        line = f"G21G90G94G53G1X{x:.3f}Y{y:.3f}Z{z:.3f}F{60e3 * speed:.1f}"
        try:
            begun = self._send(line, ANSWER, stopped, stamp)
            # The answer to the dwell marks the end of the move.
            ended = None if begun is None else self._send("G4P0.01", ANSWER, stopped, stamp)
            if begun is not None and ended is not None:
                stamp(self._query()[1])
                return begun, ended
        except DeviceError as wrong:
            raise type(wrong)(f"{wrong}; {self._hold()}") from wrong
        except BaseException:
            self._hold()
            raise
        self._hold()
        return None

    def _hold(self) -> str:
        """Stop with a feed hold, cancel the rest of the move by a reset at standstill, and describe the result.

        A reset in motion would lose the position.
        """
        self._line = ""
        try:
            self._io(lambda port: port.write(HOLD))
            if self._locked:
                return f"the stage is locked; its last position was {self.stands}"
            end = time.monotonic() + 2 * ANSWER
            while (state := self._query()[0]) not in ("Hold:0", "Idle"):
                if state == "Alarm" or time.monotonic() > end:
                    raise self._wrong(f"expected standstill (Hold:0), got {state}")
            self._io(lambda port: port.write(RESET))
            self._start()
            return f"the stage was stopped at {self.stands}"
        except LinkLostError as wrong:
            return (
                "the feed hold may not have reached the stage, which may finish its current move; switch it off "
                f"if necessary ({wrong})"
            )
        except DeviceError as wrong:
            return f"the stage was stopped, but: {wrong}"

    def _start(self) -> None:
        """Wait for the first report; a board that restarts sends its greeting first and does not answer before."""
        self._report = None
        end = time.monotonic() + self._search
        while not self._listen():
            self._ask()
            if time.monotonic() > end:
                raise LinkLostError(
                    f"{self.name}: expected a status report of Grbl 1.1 with MPos, got none in {self._search:g} s; "
                    "check the port, set $10=1, and after an alarm reset the machine by its button"
                )

    def _query(self) -> tuple[str, StageStamp, str]:
        """State, position and other fields of the next status report."""
        since, self._asked = time.monotonic(), -np.inf
        while not self._listen() or self._report is None:
            self._ask(since)
        return self._report

    def _send(
        self,
        line: str,
        limit: float = ANSWER,
        stopped: Callable[[], bool] = lambda: False,
        stamp: Callable[[StageStamp], object] | None = None,
    ) -> float | None:
        """Send a line and return the time of its answer, None if `stopped` first; LinkLostError after `limit` s.

        With `stamp`, the position is queried meanwhile, and the limit counts from the last report that the machine
        runs; it must not be in another state than Idle or Run.
        """
        self._line = line
        self._io(lambda port: port.write(f"{line}\n".encode()))
        begun = running = time.monotonic()
        while self._line:
            if stopped():
                return None
            if stamp is not None:
                self._ask(begun)
            if time.monotonic() > running + limit:
                found = "" if self._report is None else f"; it reports {self._report[0]} at {self.stands}"
                raise LinkLostError(
                    f"{self.name}: expected the answer to {line} within {limit:.3g} s, got none{found}; "
                    "check the cable, and home the machine if it was reset"
                )
            if self._listen() and stamp is not None and self._report is not None:
                state = self._report[0]
                if state not in ("Idle", "Run"):
                    means = STATES.get(state.partition(":")[0], "home it before the next stroke")
                    raise self._wrong(f"expected it to move (Run), got {state}: {means}")
                stamp(self._report[1])
                running = self._reported if state == "Run" else running
        return time.monotonic()

    def _ask(self, since: float = np.inf) -> None:
        """Query the status if that is due; LinkLostError if no report has come for 2 s, counted from `since` on."""
        now = time.monotonic()
        if now - max(since, self._reported) > ANSWER:
            raise LinkLostError(f"{self.name}: expected a status report, got no answer for {ANSWER:g} s")
        # A damaged report is queried again.
        if now - self._asked >= (QUERY_INTERVAL if self._reported > self._asked else 0.5):
            self._io(lambda port: port.write(QUERY))
            # Taken after writing, so that delays of this computer do not count as transmission time.
            self._asked = time.monotonic()

    def _listen(self) -> bool:
        """Read the received data, up to a status report; True if there is one."""
        self._received += self._io(lambda port: port.read(max(1, port.in_waiting)))
        while b"\n" in self._received:
            line, _, self._received = self._received.partition(b"\n")
            if self._handled(line.decode("ascii", "replace").strip()):
                return True
        return False

    def _handled(self, line: str) -> bool:
        """Handle one line; True if it is a status report. Answers to no line are old ones."""
        if found := REPORT.fullmatch(line):
            self._reported = time.monotonic()
            # The position is that at about the middle between query and answer.
            when = (self._reported + max(self._asked, self._reported - ANSWER)) / 2
            x, y, z = (float(part) for part in found.groups()[1:4])
            feed = re.search(r"\|FS?:([\d.]+)", fields := found[5] or "")
            stamp = StageStamp(
                time=when, position=(1e-3 * x, 1e-3 * y, 1e-3 * z), feed=float(feed[1]) / 60e3 if feed else 0.0
            )
            self._report, self.stands = (found[1], stamp, fields), f"x {x:.3f}, y {y:.3f}, z {z:.3f} mm"
            return True
        if line.startswith("ALARM:"):
            self._locked = True
            raise self._wrong(f"{_with_meaning(line)}; reset the machine, inspect it, and home it again")
        if line.startswith(GREETINGS) and self._report is not None:
            self._line = ""
            raise self._wrong("the machine was reset or restarted; home it again")
        if self._line and (line == "ok" or line.startswith("error:")):
            answered, self._line = self._line, ""
            if line != "ok":
                raise self._wrong(f"Grbl rejected {answered}: {_with_meaning(line)}")
        elif found := re.fullmatch(rf"\$(\d+)={_NUMBER}(\s.*)?", line):
            self._settings[int(found[1])] = float(found[2])
        elif line.startswith("[VER:"):
            self.firmware = f"Grbl {line[5:].split(':')[0].rstrip(']')}"
        return False

    def _io(self, call: Callable[[Any], Any]) -> Any:
        """Call the port, and convert pyserial's errors: OSError, and TypeError if it was closed meanwhile."""
        try:
            return call(self._port)
        except (OSError, TypeError) as wrong:
            raise LinkLostError(f"{self.name}: lost the port: {wrong}") from wrong

    def _wrong(self, words: str) -> DeviceError:
        return DeviceError(f"{self.name}: {words}")


def _with_meaning(line: str) -> str:
    """An alarm or error with its meaning, such as "ALARM:1, a limit switch was hit"."""
    means: str | None = _STORED["alarms_and_errors"].get(line)
    return line if means is None else f"{line}, {means}"
