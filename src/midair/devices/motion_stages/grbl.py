"""A motion stage with Grbl 1.1, such as a small milling machine, on a serial port; needs the extra `serial`.

Only one line is sent at a time, so that the machine stops at the end of a move if the connection fails. If the program
is killed or hangs during a move, its guard (`port_guard`) stops the machine. Protocol: gnea/grbl, doc/markdown,
interface.md and commands.md.
"""

import math
import os
import sys
import time
import tomllib
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import serial

from midair.devices.interface import StageDevice
from midair.devices.safety import PortGuard, device_lock
from midair.errors import DeviceError, DeviceStateError, InputError, LinkLostError
from midair.model import Place, StageStamp, check_reached

QUERY_INTERVAL = 0.1
"""Seconds between two status queries; Grbl's makers advise against more than ten per second."""
ANSWER_LIMIT = 2.0
"""Seconds without an answer to a query after which the connection counts as lost."""
DAMAGED_LIMIT = 4
"""Number of damaged status reports in a row at which the connection counts as lost."""
HOMING, MARGIN = 120.0, 2.0
"""Time limits in s: for homing, during which Grbl does not answer; for a move, beyond the time that it takes."""
HOLD, RESET, QUERY = b"!", b"\x18", b"?"
GREETINGS = ("Grbl ", "GrblHAL ")
"""Begin of the line that Grbl and grblHAL send after a reset."""

_STORED = tomllib.loads(Path(__file__).with_name("grbl_messages.toml").read_text(encoding="utf-8"))
MEANINGS: Mapping[str, str] = _STORED["alarms_and_errors"]
STATES: Mapping[str, str] = _STORED["states"]
"""Explanations of the machine's states other than Idle and Alarm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusReport:
    """Contents of a status report; positions in the unit of the report (mm or inches)."""

    state: str
    """For example Idle, Run or Hold:0."""
    position: Place
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
    state, *rest = line[1:-1].split("|")
    if not (line.startswith("<") and line.endswith(">")) or state.partition(":")[0] not in ("Idle", "Alarm", *STATES):
        return None
    fields = dict(part.split(":", 1) for part in rest if ":" in part)
    try:
        return StatusReport(
            state=state,
            position=_parse_position(fields["WPos"] if "WPos" in fields else fields["MPos"]),
            work="WPos" in fields,
            offset=_parse_position(fields["WCO"]) if "WCO" in fields else None,
            feed=float((fields.get("FS") or fields.get("F") or "0").split(",")[0]),
            pins=fields.get("Pn", ""),
        )
    except (KeyError, ValueError):
        return None


def with_meaning(line: str) -> str:
    """An alarm or error with its meaning, such as "ALARM:1, a limit switch was hit"."""
    return f"{line}, {MEANINGS[line]}" if line in MEANINGS else line


class GrblStage(StageDevice):
    """A machine with three axes on `port`, such as ``/dev/ttyUSB0`` or ``COM3``.

    `search` limits the time to the first answer, in s: opening the port restarts many boards.
    """

    def __init__(self, port: str, *, baud: int = 115_200, search: float = 5.0) -> None:
        self.name = f"grbl:{port}"
        self._port_name, self._baud, self._search = port, baud, search
        self._resources = ExitStack()
        self._port: Any = None
        self._guard: PortGuard | None = None
        # starting: until the first report, answers are old ones. holding: answers to cancelled lines may still arrive.
        self._phase: Literal["starting", "working", "holding", "locked"] = "starting"
        self._greeted = self._moving = False
        self._line, self._partial = "", b""
        self._asked: float | None = None
        self._reported_at = self._when = -math.inf
        self._damaged = 0
        self._report: StatusReport | None = None
        self._offset: Place = (0.0, 0.0, 0.0)
        self._settings: dict[int, float] = {}
        self._version = ""

    def open(self) -> None:
        """Open the port and wait for the first status report."""
        with ExitStack() as hold:
            # The real path, since one port has several names; a sensor on the same port is refused as well.
            hold.enter_context(device_lock(f"serial:{os.path.realpath(self._port_name)}"))
            how: dict[str, Any] = {"timeout": 0.01, "write_timeout": 1.0}
            try:
                self._port = serial.Serial(
                    self._port_name, self._baud, exclusive=True if os.name == "posix" else None, **how
                )
            except (OSError, ValueError) as wrong:
                raise DeviceError(f"{self.name}: expected a port, got: {wrong}; see midair doctor") from wrong
            hold.callback(self._release)
            self._start()
            if sys.platform != "win32":
                words = ("a move", "stopped the stage", "open the stage again")
                self._guard = PortGuard(self.name, [self._port.fileno()], HOLD, (QUERY, b"Hold:0", RESET), words=words)
                hold.callback(self._guard.close)
            self._resources = hold.pop_all()

    def close(self) -> None:
        """Close the port."""
        self._resources.close()

    def describe(self) -> dict[str, str]:
        """Firmware, state and position."""
        if self._report is None:
            return {}
        return {"firmware": f"Grbl {self._version}", "state": self._report.state, "stands": self._position_text()}

    def ready(self, *, homing: bool) -> StageStamp:
        """Return the position if the machine is ready to move."""
        report = self._query_status()
        state = report.state.partition(":")[0]
        if state == "Alarm":
            raise DeviceError(
                f"{self.name}: it is locked (Alarm) and its position is unknown; remove all obstacles, "
                "then home it: --home"
            )
        if state != "Idle":
            means = STATES.get(state, "it is not at rest")
            raise DeviceError(f"{self.name}: expected a machine at rest (Idle), got {report.state}: {means}")
        self._run("$$")
        self._run("$I")
        if not self._version.startswith("1.1"):
            raise DeviceError(f"{self.name}: expected Grbl 1.1, got {self._version or 'no version'}")
        if pressed := sorted(set(report.pins) & set("XYZ")):
            raise DeviceError(f"{self.name}: a limit switch is pressed ({', '.join(pressed)}); move it off by hand")
        if homing and not self._setting(22):
            raise DeviceError(
                f"{self.name}: it has no limit switches ($22=0), so that 0 is the position at power-on; if you set "
                'that position by hand each time, write homing = "by hand" into the stage\'s file'
            )
        return self._stamp(self._query_status())

    def home(self, stopped: Callable[[], bool]) -> None:
        """Run the homing cycle ($H), during which Grbl does not answer."""
        if (state := self._query_status().state) not in ("Idle", "Alarm"):
            raise DeviceError(f"{self.name}: expected a machine at rest, got {state}")
        homed = False
        try:
            with self._guarded_motion():
                homed = self._run("$H", lambda: HOMING, stopped)
        finally:
            if not homed:
                # During homing Grbl ignores a hold, but not a reset.
                self._line = ""
                with suppress(DeviceError):
                    self._write(RESET)
        if not homed:
            raise DeviceError(f"{self.name}: stopped during homing; its position is unknown, home it again")

    def check_speed(self, speed: float, way: float, axis: int) -> None:
        """Check against the maximum rate ($110 to $112) and acceleration ($120 to $122)."""
        largest, growth = self._setting(110 + axis) / 60e3, self._setting(120 + axis) / 1e3
        check_reached(speed, way, largest=largest, growth=growth)

    def move(
        self, target: Place, speed: float, *, stamp: Callable[[StageStamp], object], stopped: Callable[[], bool]
    ) -> tuple[float, float] | None:
        """Move in one straight line (G1 in machine coordinates), then dwell; the answer to the dwell marks the end."""
        x, y, z = (1e3 * part for part in target)
        line = f"G21G90G94G53G1X{x:.3f}Y{y:.3f}Z{z:.3f}F{60e3 * speed:.1f}"
        with self._guarded_motion():
            try:
                taken = self._run(line, lambda: ANSWER_LIMIT, stopped, stamp)
                begin = time.monotonic()
                if taken and self._run("G4P0.01", lambda: self._time_left(target, speed), stopped, stamp):
                    end = time.monotonic()
                    stamp(self._stamp(self._query_status()))
                    return begin, end
            except DeviceError as wrong:
                raise type(wrong)(f"{wrong}; {self._hold()}") from wrong
            except BaseException:
                self._hold()
                raise
            self._hold()
            return None

    def _time_left(self, target: Place, speed: float) -> float:
        """Time limit in s for the rest of a move, at the rates and accelerations of its axes."""
        start = self._stamp(self._report or self._query_status()).position
        ways = [abs(end - begin) for begin, end in zip(start, target, strict=True)]
        way, growth = math.hypot(*ways), math.inf
        for axis, part in enumerate(ways):
            if part > 0:
                speed = min(speed, way / part * self._setting(110 + axis) / 60e3)
                growth = min(growth, way / part * self._setting(120 + axis) / 1e3)
        return way / speed + speed / growth + MARGIN

    @contextmanager
    def _guarded_motion(self) -> Generator[None]:
        """While inside, the guard stops the machine if this program is killed, or hangs."""
        self._moving = True
        try:
            self._beat()
            yield
        finally:
            self._moving = False
            if self._guard is not None:
                self._guard.rest()

    def _beat(self) -> None:
        """Send a heartbeat to the guard during a move; none after its error, while the move is stopped."""
        if self._moving and self._guard is not None:
            self._moving = False
            self._guard.beat()
            self._moving = True

    def _start(self) -> None:
        """Wait for the first report; a restarting board sends its greeting first."""
        end, self._report = time.monotonic() + self._search, None
        while self._report is None:
            if time.monotonic() > end:
                raise DeviceError(
                    f"{self.name}: expected a status report of Grbl 1.1, got none in {self._search:g} s; check the "
                    "port, and after an alarm reset the machine by its button"
                )
            self._asked = None
            self._wait_for_report(0.5)
        self._phase = "working"

    def _setting(self, number: int) -> float:
        if number not in self._settings:
            raise DeviceError(f"{self.name}: expected the setting ${number} of Grbl 1.1, got none; check the firmware")
        return self._settings[number]

    def _run(
        self,
        line: str,
        limit: Callable[[], float] = lambda: ANSWER_LIMIT,
        stopped: Callable[[], bool] = lambda: False,
        stamp: Callable[[StageStamp], object] | None = None,
    ) -> bool:
        """Send a line and read until it is answered; False if `stopped` first.

        With `stamp`, the position is queried continuously. Raises LinkLostError after `limit` in s, which is renewed
        when a report makes it shorter: a machine that moves slowly has time, one that has ended or restarted has none.
        """
        self._line = line
        self._write(f"{line}\n".encode())
        least = limit()
        end = time.monotonic() + least
        while self._line:
            if stopped():
                return False
            if time.monotonic() > end:
                state = "" if self._report is None else f"; it reports {self._report.state} at {self._position_text()}"
                raise LinkLostError(
                    f"{self.name}: expected the answer to {line} within {least:.3g} s, got none{state}; "
                    "check the cable, and home the machine if it was reset"
                )
            if stamp is not None:
                self._query_when_due()
            if (report := self._listen()) is not None and stamp is not None:
                self._check_moving(report)
                stamp(self._stamp(report))
                if (left := limit()) < least:
                    least, end = left, time.monotonic() + left
        return True

    def _check_moving(self, report: StatusReport) -> None:
        state = report.state.partition(":")[0]
        if state == "Alarm":
            raise DeviceError(f"{self.name}: alarm during the move; home it before the next stroke")
        if state not in ("Idle", "Run"):
            raise DeviceError(f"{self.name}: expected it to move (Run), got {report.state}: {STATES.get(state, '')}")

    def _query_when_due(self) -> None:
        now = time.monotonic()
        if self._asked is None and now - self._reported_at >= QUERY_INTERVAL:
            self._query()
        elif self._asked is not None and now - self._asked > ANSWER_LIMIT:
            raise LinkLostError(f"{self.name}: expected a status report, got no answer for {ANSWER_LIMIT:g} s")

    def _query(self) -> None:
        self._write(QUERY)
        # Taken after writing, so that delays of this computer do not count as transmission time.
        self._asked = time.monotonic()

    def _query_status(self) -> StatusReport:
        if (report := self._wait_for_report(ANSWER_LIMIT)) is None:
            raise LinkLostError(f"{self.name}: expected a status report, got none in {ANSWER_LIMIT:g} s")
        return report

    def _wait_for_report(self, limit: float) -> StatusReport | None:
        """Query unless an answer is due, and wait for it; a damaged report is queried again."""
        end = time.monotonic() + limit
        while time.monotonic() < end:
            if self._asked is None:
                self._query()
            if (report := self._listen()) is not None:
                return report
        return None

    def _listen(self) -> StatusReport | None:
        """Read the received data, up to a report."""
        self._beat()
        self._partial += self._io(lambda port: port.read(max(1, port.in_waiting)))
        while b"\n" in self._partial:
            line, _, self._partial = self._partial.partition(b"\n")
            if (report := self._handle_line(line.decode("ascii", "replace").strip())) is not None:
                return report
        return None

    def _handle_line(self, line: str) -> StatusReport | None:
        if line == "ok" or line.startswith("error:"):
            if self._phase == "starting" or (self._phase == "holding" and line == "ok"):
                return None
            answered, self._line = self._line, ""
            if not answered:
                raise DeviceError(f"{self.name}: got an answer to no line; close other programs that use the port")
            if line != "ok":
                raise DeviceError(f"{self.name}: Grbl rejected {answered}: {with_meaning(line)}")
        elif line.startswith("ALARM:"):
            self._phase = "locked"
            raise DeviceError(f"{self.name}: {with_meaning(line)}; reset the machine, inspect it, and home it again")
        elif line.startswith(GREETINGS):
            self._greeted, self._line = True, ""
            # In a hold the guard may have reset it; a reset in motion would show as an alarm.
            if self._phase not in ("starting", "holding"):
                raise DeviceError(f"{self.name}: the machine was reset or restarted; home it again")
        elif line.startswith("$") and "=" in line:
            number, _, value = line[1:].partition("=")
            with suppress(ValueError):
                self._settings[int(number)] = float(value)
        elif line.startswith("[VER:"):
            self._version = line[5:].split(":")[0].rstrip("]")
        elif (report := parse_status(line)) is not None:
            self._report, self._reported_at, self._damaged = report, time.monotonic(), 0
            # The position is that at about the middle between query and answer.
            self._when = self._reported_at if self._asked is None else (self._reported_at + self._asked) / 2
            self._asked = None
            self._offset = report.offset or self._offset
            return report
        elif line.startswith("<"):
            self._damaged, self._asked = self._damaged + 1, None
            if self._damaged == DAMAGED_LIMIT:
                raise LinkLostError(f"{self.name}: expected a status report, got {line!r}; check cable and baud rate")
        return None

    def _stamp(self, report: StatusReport) -> StageStamp:
        scale = 25.4e-3 if self._settings.get(13) else 1e-3
        x, y, z = report.position
        if report.work:
            x, y, z = (part + more for part, more in zip((x, y, z), self._offset, strict=True))
        return StageStamp(time=self._when, position=(x * scale, y * scale, z * scale), feed=report.feed * scale / 60)

    def _position_text(self) -> str:
        if self._report is None:
            return "an unknown position"
        x, y, z = (1e3 * part for part in self._stamp(self._report).position)
        return f"x {x:.3f}, y {y:.3f}, z {z:.3f} mm"

    def _hold(self) -> str:
        """Stop with a feed hold and cancel pending moves; return a description of the result."""
        locked = self._phase == "locked"
        self._phase = "locked" if locked else "holding"
        try:
            self._write(HOLD)
            self._line = ""
            if locked:
                return f"the stage is locked; its last position was {self._position_text()}"
            self._wait_for_standstill()
            return f"the stage was stopped at {self._position_text()}"
        except LinkLostError as wrong:
            return (
                "the feed hold may not have reached the stage, which may finish its current move; switch it off "
                f"if necessary ({wrong})"
            )
        except DeviceError as wrong:
            return f"the stage was stopped, but: {wrong}"
        finally:
            self._phase = "locked" if self._phase == "locked" else "working"

    def _wait_for_standstill(self) -> None:
        """Wait for standstill, then reset to cancel the rest of the move; a reset in motion would lose the position."""
        end = time.monotonic() + 2 * ANSWER_LIMIT
        while (state := self._query_status().state) not in ("Hold:0", "Idle"):
            if state == "Alarm" or time.monotonic() > end:
                raise DeviceError(f"{self.name}: expected standstill (Hold:0), got {state}")
        self._phase, self._greeted = "starting", False
        self._write(RESET)
        end = time.monotonic() + ANSWER_LIMIT
        while not self._greeted and time.monotonic() < end:
            self._listen()
        self._start()

    def _write(self, data: bytes) -> None:
        self._io(lambda port: port.write(data))

    def _io(self, call: Callable[[Any], Any]) -> Any:
        """Call the port, and convert pyserial's errors: OSError, and TypeError if it was closed meanwhile."""
        if self._port is None:
            raise DeviceStateError(f"{self.name}: expected open first")
        try:
            return call(self._port)
        except (OSError, TypeError) as wrong:
            raise LinkLostError(f"{self.name}: lost the port: {wrong}") from wrong

    def _release(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            port.close()


def grbl_stage(port: str, options: Mapping[str, str]) -> GrblStage:
    """Stage at a port; the option baud is bits per second. Raises InputError if an option is unknown or no rate."""
    baud = options.get("baud", "115200")
    if set(options) - {"baud"} or not baud.isdecimal() or not int(baud):
        unknown = next(iter(set(options) - {"baud"}), f"baud={baud}")
        raise InputError(f"expected the option baud, bits per second, got {unknown}")
    return GrblStage(port, baud=int(baud))


def _parse_position(text: str) -> Place:
    x, y, z = (float(part) for part in text.split(",")[:3])
    return x, y, z
