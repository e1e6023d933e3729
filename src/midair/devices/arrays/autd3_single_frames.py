"""AUTD3 units of series 0.12 that play single frames, each at its instant; needs the extra `autd3`.

A frame is one datagram per unit; the units queue up to seven. `put` does not wait for the answer, which is counted when
it arrives.

The SDK uses asyncio. An event loop in its own thread costs two context switches and two changes of the interpreter's
lock per frame, which take longer than computing the phases. Therefore the caller runs its own loop, `ManualEventLoop`,
between two frames; it never blocks.
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
from midair.devices.arrays.autd3 import Autd3Address
from midair.devices.arrays.autd3_udp import Autd3Udp
from midair.devices.arrays.banks import UnitsState
from midair.devices.arrays.immediate import OUTCOMES
from midair.devices.frame_bytes import Bytes
from midair.errors import DeviceError, LinkLostError, SilentFramesError, TooHotError
from midair.model import Placement

_KEPT, _CROWD = 64, 7
"""Number of frames whose time of transmission is kept, and of those in transmission at most."""


class ManualEventLoop(asyncio.AbstractEventLoop):
    """An event loop that never blocks: pending callbacks run when `turn` is called.

    It has only what futures and tasks need; other threads may only call `call_soon_threadsafe`. `at` is the time at
    which the current callback was scheduled, in ns of `time.monotonic_ns`.
    """

    def __init__(self) -> None:
        self.at = 0
        self._waiting: deque[tuple[int, Callable[..., object], tuple[Any, ...]]] = deque()

    def turn(self) -> None:
        """Run all pending callbacks, including those that they schedule."""
        if not self._waiting:
            return
        before = events._get_running_loop()  # asyncio's interface for event loops
        events._set_running_loop(self)
        try:
            while self._waiting:
                self.at, do, arguments = self._waiting.popleft()
                do(*arguments)
        finally:
            events._set_running_loop(before)

    def call_soon(self, callback: Callable[..., object], *args: Any, **_: Any) -> Any:
        """Schedule a callback in this turn, with the time of the current one."""
        self._waiting.append((self.at, callback, args))

    def call_soon_threadsafe(self, callback: Callable[..., object], *args: Any, **_: Any) -> Any:
        """Schedule a callback in the next turn."""
        self._waiting.append((time.monotonic_ns(), callback, args))

    def create_future(self) -> asyncio.Future[Any]:
        """Create a future of this loop."""
        return asyncio.Future(loop=self)

    def get_debug(self) -> bool:
        """Return False."""
        return False


class Autd3Immediate(Autd3Udp):
    """Units that play a frame from its instant on, and go silent soon after the last message.

    At most seven frames are in transmission; further ones are not sent (the units queue seven). The state is queried
    every 50 ms. `failsafe` as in `Autd3Udp`.
    """

    def __init__(self, placement: Placement, place: Autd3Address, *, failsafe: float = 0.05) -> None:
        self._counts: dict[str, int] = dict.fromkeys(OUTCOMES, 0)
        self._sent_at = np.zeros(_KEPT, np.int64)
        self._number = self._in_transmission = self._unanswered = 0
        self._wrong: DeviceError | None = None
        self._last_query, self._releases = 0.0, 0
        self._geometry = commands.geometry(placement)
        self._manual_loop = ManualEventLoop()
        self._tasks: set[asyncio.Task[None]] = set()
        super().__init__(placement, place, failsafe=failsafe, heartbeat=False)

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Send a frame that sounds from an instant on, without waiting."""
        self._manual_loop.turn()
        if self._wrong is not None:
            raise self._wrong
        number, self._number = self._number, self._number + 1
        self._sent_at[number % _KEPT] = 0
        if self._in_transmission >= _CROWD:
            self._counts["crowded"] += 1
            return
        frame = Frames.encode(self._geometry, Pattern(PhaseBuffer.from_array(phases), intensity))[0]
        if self.now() >= instant:
            self._counts["late"] += 1
            return
        self._in_transmission += 1
        self._run_task(self._send_frame(frame, instant, number))
        if (now := time.monotonic()) - self._last_query > 0.05:
            self._last_query = now
            self._run_task(self._query_state())

    def skip(self) -> None:
        """Count a frame that is dropped."""
        self._sent_at[self._number % _KEPT] = 0
        self._number += 1
        self._counts["hot"] += 1

    def release(self) -> None:
        """Release the failsafe of the units, and clear an earlier error of heat or failsafe."""
        super().release()
        self._releases += 1
        if isinstance(self._wrong, TooHotError | SilentFramesError):
            self._wrong = None

    def sent(self, number: int) -> int:
        """Time at which a frame was sent, in ns of `time.monotonic_ns`; 0 if it was not sent yet."""
        self._manual_loop.turn()
        return int(self._sent_at[number % _KEPT])

    def counts(self) -> dict[str, int]:
        """Number of frames by outcome."""
        self._manual_loop.turn()
        return dict(self._counts)

    def close(self) -> None:
        """Silence the units, as the SDK does on closing, and close the link."""
        super().close()
        # Pending answers will not arrive any more; asyncio warns about tasks destroyed while pending.
        for task in list(self._tasks):
            task.cancel()
        self._manual_loop.turn()

    def _run_task(self, work: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine at once, up to where it waits for the SDK."""
        task = asyncio.Task(work, loop=self._manual_loop)
        self._tasks.add(task)
        task.add_done_callback(self._task_ended)
        self._manual_loop.turn()

    def _task_ended(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (wrong := task.exception()) is not None:
            self._wrong = DeviceError(f"autd3: this is an error in midair, please report it: {wrong!r}")

    async def _send_frame(self, frame: Frame, instant: int, number: int) -> None:
        try:
            at = ExecAt.At(SysTime.from_nanos(instant))
            answer = await self._open.send_frame_at(frame, at)
            self._sent_at[number % _KEPT] = self._manual_loop.at
            self._counts["sent"] += 1
            await answer
            self._counts["answered"] += 1
            self._unanswered = 0
        except Autd3Error as wrong:
            self._counts["lost"] += 1
            self._unanswered += 1
            # A single lost datagram is a lost frame; many in a row mean a lost link.
            if wrong.code != Autd3Error.TIMEOUT or self._unanswered >= _CROWD:
                self._wrong = LinkLostError(
                    f"autd3: {wrong}; the units silence themselves within {self.failsafe:g} s; check cables and power"
                )
        except DeviceError:
            pass  # closed meanwhile
        finally:
            self._in_transmission -= 1

    async def _query_state(self) -> None:
        """Query the state of the units; overheating or an active failsafe is an error."""
        releases = self._releases
        try:
            states = await self._open.read_fpga_state()
        except (Autd3Error, DeviceError):
            return  # a lost link is reported by the frames
        try:
            hot = tuple(unit for unit, state in enumerate(states) if state.is_thermal_asserted())
            UnitsState(hot=hot).check_heat(f"after {self._number} frames since they were opened")
        except TooHotError as wrong:
            self._wrong = wrong
            return
        silenced = [unit for unit, state in enumerate(states) if state.is_failsafe_active()]
        # An answer may be older than the release.
        if silenced and releases == self._releases and self._wrong is None:
            self._counts["failsafe"] += 1
            self._wrong = SilentFramesError(
                f"autd3: expected every frame to sound, but the failsafe silenced units {silenced} after "
                f"{self.failsafe:g} s without a frame; close other programs, then start again"
            )
