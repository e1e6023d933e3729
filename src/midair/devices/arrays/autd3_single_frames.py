"""AUTD3 units of series 0.12 that take single frames, each with its instant. Imports the extra `autd3`.

A frame is one datagram a unit. The units keep time and queue up to seven; what is sent is not waited for, so that the
one who makes frames goes on at once, and what became of it is counted when its answer comes.

The SDK speaks asyncio. A loop of asyncio in a thread of its own costs two context switches and two turns of the
interpreter's lock a frame, which together take longer than computing the phases. So the caller runs its own loop,
`ManualEventLoop`, between two frames: it waits for nothing, and no thread has to be woken.
"""

import asyncio
import time
from asyncio import events
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
from autd3 import Autd3Error, ExecAt, Frame, Frames
from autd3.commands import Pattern
from autd3.value import SysTime
from autd3_pattern import PhaseBuffer

from midair.devices.arrays import autd3_commands as commands
from midair.devices.arrays.autd3_places import Autd3Place
from midair.devices.arrays.autd3_udp import Autd3Udp
from midair.devices.arrays.banks import UnitsState
from midair.devices.frame_bytes import Bytes
from midair.errors import DeviceError, LinkLostError, SilentFramesError, TooHotError
from midair.model import Placement

_KEPT = 64
"""Frames of which is known when they left."""


class ManualEventLoop(asyncio.AbstractEventLoop):
    """An event loop that never waits: what there is to do is done when somebody turns it.

    Only what futures and tasks need of a loop; from another thread, `call_soon_threadsafe` alone.

    Attributes
    ----------
    at : int
        When what is being done now was asked for, in ns of `time.monotonic_ns`.
    """

    def __init__(self) -> None:
        self.at = 0
        self._waiting: deque[tuple[int, Callable[..., object], tuple[Any, ...]]] = deque()

    def turn(self) -> None:
        """Do everything that was asked for, and what that asks for."""
        if not self._waiting:
            return
        before = events._get_running_loop()  # theirs, for those who write loops
        events._set_running_loop(self)
        try:
            while self._waiting:
                self.at, do, arguments = self._waiting.popleft()
                do(*arguments)
        finally:
            events._set_running_loop(before)

    def call_soon(self, callback: Callable[..., object], *args: Any, **_: Any) -> Any:
        """In this turn, as if asked for when that was which asks."""
        self._waiting.append((self.at, callback, args))

    def call_soon_threadsafe(self, callback: Callable[..., object], *args: Any, **_: Any) -> Any:
        """In the next turn."""
        self._waiting.append((time.monotonic_ns(), callback, args))

    def create_future(self) -> asyncio.Future[Any]:
        """A future of this loop."""
        return asyncio.Future(loop=self)

    def get_debug(self) -> bool:
        """Never."""
        return False


class Autd3Immediate(Autd3Udp):
    """Units that play a frame from its instant on, and go silent soon after the last word.

    Parameters
    ----------
    placement, place
        As in `Autd3Udp`.
    failsafe : float
        After how long without a frame the units silence themselves, in s.
    crowd : int
        Frames that may be under way at once; one more is not sent. The units queue seven.
    asked : float
        How often the units are asked how they are, in s.
    """

    def __init__(
        self, placement: Placement, place: Autd3Place, *, failsafe: float = 0.05, crowd: int = 7, asked: float = 0.25
    ) -> None:
        self._crowd, self._asked = crowd, asked
        self._told: dict[str, int] = dict.fromkeys(("sent", "answered", "lost", "late", "crowded"), 0)
        self._left = np.zeros(_KEPT, np.int64)
        self._number = self._flying = self._unanswered = 0
        self._wrong: DeviceError | None = None
        self._asks = 0.0
        self._geometry = commands.geometry(placement)
        self._turned = ManualEventLoop()
        self._tasks: set[asyncio.Task[None]] = set()
        super().__init__(placement, place, failsafe=failsafe, heartbeat=False)

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Send a frame that sounds from an instant on, and do not wait for it."""
        self._turned.turn()
        if self._wrong is not None:
            raise self._wrong
        number, self._number = self._number, self._number + 1
        self._left[number % _KEPT] = 0
        if self._flying >= self._crowd:
            self._told["crowded"] += 1
            return
        frame = Frames.encode(self._geometry, Pattern(PhaseBuffer.from_array(phases), intensity))[0]
        if self.now() >= instant:
            self._told["late"] += 1
            return
        self._flying += 1
        self._start(self._send_frame(frame, instant, number))
        if (now := time.monotonic()) - self._asks > self._asked:
            self._asks = now
            self._start(self._ask())

    def release(self) -> None:
        """Let units that their failsafe has silenced sound again; heat of an earlier order is forgotten."""
        super().release()
        if isinstance(self._wrong, TooHotError):
            self._wrong = None

    def sent(self, number: int) -> int:
        """When a frame left, in ns of `time.monotonic_ns`; 0 if it did not, or has not yet."""
        self._turned.turn()
        return int(self._left[number % _KEPT])

    def told(self) -> dict[str, int]:
        """What became of all frames."""
        self._turned.turn()
        return dict(self._told)

    def close(self) -> None:
        """Silence the units, as the SDK does on closing, and let go."""
        super().close()
        # What has no answer by now gets none; and a task that is forgotten while it waits complains.
        for task in list(self._tasks):
            task.cancel()
        self._turned.turn()

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        """Begin on the spot: up to where the SDK has it."""
        task = asyncio.Task(work, loop=self._turned)
        self._tasks.add(task)
        task.add_done_callback(self._end)
        self._turned.turn()

    def _end(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (wrong := task.exception()) is not None:
            self._wrong = DeviceError(f"autd3: this is an error in midair, please report it: {wrong!r}")

    async def _send_frame(self, frame: Frame, instant: int, number: int) -> None:
        try:
            at = ExecAt.At(SysTime.from_nanos(instant))
            answer = await self._open.send_frame_at(frame, at)
            self._left[number % _KEPT] = self._turned.at
            self._told["sent"] += 1
            await answer
            self._told["answered"] += 1
            self._unanswered = 0
        except Autd3Error as wrong:
            self._told["lost"] += 1
            self._unanswered += 1
            # One datagram that is lost is a frame that was not felt; many in a row are a link that is.
            if wrong.code != Autd3Error.TIMEOUT or self._unanswered >= self._crowd:
                self._wrong = LinkLostError(
                    f"autd3: {wrong}; the units silence themselves within {self.failsafe:g} s; check cables and power"
                )
        except DeviceError:
            pass  # closed meanwhile
        finally:
            self._flying -= 1

    async def _ask(self) -> None:
        """Ask the units how they are: those that are too hot must be silent, and those in failsafe are."""
        try:
            states = await self._open.read_fpga_state()
        except (Autd3Error, DeviceError):
            return  # frames that get no answer say so
        try:
            hot = tuple(unit for unit, state in enumerate(states) if state.is_thermal_asserted())
            UnitsState(hot=hot).check_heat(f"after {self._number} frames since they were opened")
        except TooHotError as wrong:
            self._wrong = wrong
            return
        silenced = [unit for unit, state in enumerate(states) if state.is_failsafe_active()]
        if silenced:
            self._wrong = SilentFramesError(
                f"autd3: expected every frame to sound, but the failsafe silenced units {silenced} after "
                f"{self.failsafe:g} s without a frame; look for what held the computer up, then start again"
            )
