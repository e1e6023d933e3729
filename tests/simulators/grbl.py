"""A simulated Grbl 1.1 machine on a pty: responses, receive buffer, planner, and the duration of moves.

Written from the makers' documentation only (gnea/grbl, doc/markdown: interface.md, commands.md, jogging.md), without
the driver's code. Not simulated: junctions (each line ends at rest), arcs, probing, overrides, jogging,
other G-codes than those of `MOVE` and G4. POSIX only.
"""

import contextlib
import os
import re
import select
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tests.simulators.pty_device import BehindPty

Vector = NDArray[np.float64]

USUAL = {
    **{10: 1.0, 13: 0.0, 20: 0.0, 21: 1.0, 22: 1.0, 27: 1.0},
    **dict.fromkeys((110, 111, 112), 12000.0),
    **dict.fromkeys((120, 121, 122), 500.0),
    **dict.fromkeys((130, 131, 132), 250.0),
}
"""Default settings: status mask, inches, soft and hard limits, homing, pull-off (mm); mm/min, mm/s2 and mm of each
axis.
"""

NUMBER = r"([-+]?\d*\.?\d+)"
MOVE = re.compile(f"G21G90G94G53G1X{NUMBER}Y{NUMBER}Z{NUMBER}F{NUMBER}")
"""The one line that moves: in mm, absolute, in coordinates of the machine, with a feed rate in mm/min."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlannedMove:
    """A straight move with constant acceleration, constant speed and deceleration to rest; in mm and s."""

    start: Vector
    end: Vector
    speed: float
    growth: float
    begun: float = 0.0
    stopped: float | None = None

    @property
    def length(self) -> float:
        """Length of the line."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def top(self) -> float:
        """Highest speed reached."""
        return min(self.speed, float(np.sqrt(self.growth * self.length)))

    @property
    def duration(self) -> float:
        """Duration from rest to rest, unless held."""
        return self.length / self.top + self.top / self.growth if self.length else 0.0

    def _free(self, after: float) -> tuple[float, float]:
        """Distance and speed after a time, if not held."""
        up, whole = self.top / self.growth, self.duration
        if after <= 0 or not self.length:
            return 0.0, 0.0
        if after >= whole:
            return self.length, 0.0
        if after < up:
            return self.growth * after**2 / 2, self.growth * after
        if after > whole - up:
            left = whole - after
            return self.length - self.growth * left**2 / 2, self.growth * left
        return self.top * (after - up / 2), self.top

    def at(self, now: float) -> tuple[Vector, float]:
        """Position and speed."""
        way, speed = self._free((now if self.stopped is None else min(now, self.stopped)) - self.begun)
        if self.stopped is not None and now > self.stopped:
            slowing = min(now - self.stopped, speed / self.growth)
            way, speed = way + speed * slowing - self.growth * slowing**2 / 2, speed - self.growth * slowing
        whole = self.length
        return self.start + (self.end - self.start) * (way / whole if whole else 1.0), speed

    def over(self, now: float) -> bool:
        """Whether the move has ended, held or not."""
        speed = self.at(now)[1]
        return speed <= 1e-9 and now > self.begun and (self.stopped is not None or now >= self.begun + self.duration)


class GrblSimulator(BehindPty):
    """A simulated Grbl machine; a driver opens `port`, and `close` ends it.

    If homing is enabled and not done (`homed`), the machine is locked. `settings` differ from `USUAL`; `lines` and
    `moves` hold what was received and started, `lost` the bytes that did not fit into the receive buffer. `switch` may
    be set to axis and position in mm of a limit switch, `mute` to True.
    """

    RECEIVES = 128
    PLANS = 15
    RATE = 11_520
    """Bytes in a second, in both directions."""

    def __init__(self, *, homed: bool = True, settings: Mapping[int, float] | None = None) -> None:
        super().__init__()
        self.settings = {**USUAL, **(settings or {})}
        self.lines: list[str] = []
        self.moves: list[PlannedMove] = []
        self.lost = 0
        self.switch: tuple[int, float] | None = None
        self.mute = False
        self._place = np.full(3, -self.settings[27]) if homed else np.zeros(3)
        self._locked = bool(self.settings[22]) and not homed
        self._critical = False
        self._target = self._place.copy()
        self._received, self._line, self._leaving = bytearray(), bytearray(), bytearray()
        self._plan: deque[PlannedMove] = deque()
        self._now: PlannedMove | None = None
        self._held = self._reset = False
        self._asked: float | None = None
        self._dwell: float | None = None
        self._waiting: tuple[str, float] | None = None
        self._homing: float | None = None
        self._reports = 0
        self._clock = time.monotonic()
        self.switch_on()

    @property
    def place(self) -> Vector:
        """Position in mm."""
        return self._place.copy()

    @property
    def state(self) -> str:
        """State as in a status report."""
        if self._locked:
            return "Alarm"
        if self._homing is not None:
            return "Home"
        if self._held:
            return "Hold:0" if self._now is None or self._now.over(time.monotonic()) else "Hold:1"
        return "Run" if self._now is not None or self._plan else "Idle"

    def _run(self) -> None:
        self._greet()
        while not self._over.is_set():
            now = time.monotonic()
            self._transfer(now)
            self._move(now)
            if self._reset:
                self._restart(now)
            elif not self._critical:
                self._work(now)
                self._answer(now)
            time.sleep(0.001)

    # The serial line: bytes at the baud rate in both directions; real-time characters bypass the buffer.

    def _transfer(self, now: float) -> None:
        room = int((now - self._clock) * self.RATE)
        if room < 1:
            return
        self._clock += room / self.RATE
        if select.select([self._master], [], [], 0)[0]:
            for byte in os.read(self._master, min(room, 4096)):
                self._receive(byte, now)
        if self._leaving:
            with contextlib.suppress(BlockingIOError):
                del self._leaving[: os.write(self._master, self._leaving[:room])]

    def _receive(self, byte: int, now: float) -> None:
        if byte == 0x18:
            self._reset = True
        elif byte == ord("?"):
            # A second query before the answer to the first is ignored.
            self._asked = now if self._asked is None else self._asked
        elif byte == ord("!"):
            self._hold(now)
        elif byte == ord("~"):
            self._resume()
        elif len(self._received) < self.RECEIVES - 1:
            self._received.append(byte)
        else:
            self.lost += 1

    def _say(self, line: str) -> None:
        if not self.mute:
            self._leaving += f"{line}\r\n".encode()

    def _greet(self) -> None:
        self._say("")
        self._say("Grbl 1.1h ['$' for help]")
        if self._locked:
            self._say("[MSG:'$H'|'$X' to unlock]")

    def _answer(self, now: float) -> None:
        """Send a status report 8 ms after the query."""
        if self._asked is None or now - self._asked < 0.008 or self._homing is not None:
            return
        self._asked = None
        speed = 0.0 if self._now is None else self._now.at(now)[1]
        scale = 25.4 if self.settings[13] else 1.0
        x, y, z = self._place / scale
        offset = "|WCO:0.000,0.000,0.000" if self._reports % 10 == 0 else ""
        name = "MPos" if int(self.settings[10]) & 1 else "WPos"
        self._reports += 1
        self._say(f"<{self.state}|{name}:{x:.3f},{y:.3f},{z:.3f}|FS:{speed * 60 / scale:.0f},0{offset}>")

    # Motion.

    def _move(self, now: float) -> None:
        if self._now is None and self._plan and not self._held:
            self._now = replace(self._plan.popleft(), start=self._place.copy(), begun=now, stopped=None)
            self.moves.append(self._now)
        if self._now is None:
            return
        before, (self._place, _) = self._place, self._now.at(now)
        if self.switch is not None:
            axis, at = self.switch
            if (before[axis] - at) * (self._place[axis] - at) < 0:
                self._alarm(1, now)
                return
        if self._now.stopped is None and self._now.over(now):
            self._place, self._now = self._now.end.copy(), None

    def _hold(self, now: float) -> None:
        if self._critical or self._locked or self._homing is not None:
            return
        self._held = True
        if self._now is not None and self._now.stopped is None:
            self._now = self.moves[-1] = replace(self.moves[-1], stopped=now)

    def _resume(self) -> None:
        if not self._held:
            return
        self._held = False
        if self._now is not None:
            self._plan.appendleft(self._now)
            self._now = None

    def _alarm(self, number: int, now: float) -> None:
        if self._now is not None:
            self.moves[-1] = replace(self.moves[-1], stopped=now)
        self._now = None
        self._plan.clear()
        self._locked = self._critical = True
        self._say(f"ALARM:{number}")
        self._say("[MSG:Reset to continue]")

    def _restart(self, now: float) -> None:
        """Ctrl-X: reset the state; the position is lost if the machine moved."""
        self._reset = False
        moving = self._now is not None and not self._now.over(now)
        if moving or self._homing is not None:
            self._locked = True
            self._say("ALARM:3" if moving else "ALARM:6")
        self._plan.clear()
        self._now = self._dwell = self._waiting = self._homing = self._asked = None
        self._held = self._critical = False
        self._received.clear()
        self._line.clear()
        self._target = self._place.copy()
        self._greet()

    # Lines are read from the buffer and answered one by one.

    def _work(self, now: float) -> None:
        if self._homing is not None:
            if now >= self._homing:
                self._homing, self._locked = None, False
                self._place = np.full(3, -self.settings[27])
                self._target = self._place.copy()
                self._say("ok")
            return
        if self._dwell is not None:
            self._wait_out(now)
            return
        if len(self._plan) >= self.PLANS or b"\n" not in self._received.replace(b"\r", b"\n"):
            return
        text = bytes(self._received.replace(b"\r", b"\n")).split(b"\n", 1)[0]
        del self._received[: len(text) + 1]
        line = text.decode("latin-1").replace(" ", "").upper()
        self.lines.append(line)
        answer = self._system(line, now) if line.startswith("$") else self._block(line, now)
        if answer:
            self._say(answer)

    def _wait_out(self, now: float) -> None:
        """A dwell: wait for all planned moves, then for the dwell time."""
        if self._dwell is None or self._now is not None or self._plan or self._held:
            return
        if self._waiting is None:
            self._waiting = ("dwell", now + self._dwell)
        elif now >= self._waiting[1]:
            self._dwell = self._waiting = None
            self._say("ok")

    def _system(self, line: str, now: float) -> str:
        if line in ("$$", "$I", "$H") and self.state not in ("Idle", "Alarm"):
            return "error:8"
        if line == "$$":
            for number, value in sorted(self.settings.items()):
                self._say(
                    f"${number}={value:.3f}" if number >= 20 and number not in (20, 21, 22) else f"${number}={value:g}"
                )
            self._say("$302=192.168.5.1")  # as grblHAL with a network says
        elif line == "$I":
            self._say("[VER:1.1h.20190825:]")
            self._say("[OPT:V,15,128]")
        elif line == "$H":
            if not self.settings[22]:
                return "error:5"
            self._homing = now + 0.3
            return ""
        else:
            return "error:3"
        return "ok"

    def _block(self, line: str, now: float) -> str:
        if self._locked:
            return "error:9"
        if len(line) > 80:
            return "error:11"
        if line.startswith("G4P"):
            self._dwell = float(line[3:])
            return ""
        move = MOVE.fullmatch(line)
        if move is None:
            return "error:20"
        *target, feed = (float(number) for number in move.groups())
        return self._plan_line(np.array(target), feed / 60, now)

    def _plan_line(self, target: Vector, speed: float, now: float) -> str:
        travel = np.array([self.settings[130 + axis] for axis in range(3)])
        if self.settings[20] and ((target > 0) | (target < -travel)).any():
            self._alarm(2, now)
            return ""
        step = target - self._target
        length = float(np.linalg.norm(step))
        if length:
            share = np.maximum(np.abs(step) / length, 1e-12)
            fastest = min(self.settings[110 + axis] / 60 / share[axis] for axis in range(3))
            growth = min(self.settings[120 + axis] / share[axis] for axis in range(3))
            self._plan.append(
                PlannedMove(start=self._target.copy(), end=target, speed=min(fastest, speed), growth=growth)
            )
        self._target = target
        return "ok"
