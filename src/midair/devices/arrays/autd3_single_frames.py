"""AUTD3 units of series 0.12 that take single frames, each with its instant. Imports the extra `autd3`.

A frame is one datagram a unit. The units keep time and queue up to seven; what is sent is not waited for, so that the
one who makes frames goes on at once, and what became of it is counted when its answer comes.
"""

import asyncio
import time
from collections.abc import Coroutine
from typing import Any

import numpy as np
from autd3 import Autd3Error, ExecAt, Frame, Frames
from autd3.commands import Pattern
from autd3.value import SysTime
from autd3_pattern import PhaseBuffer

from midair.devices.arrays import autd3_commands as commands
from midair.devices.arrays.autd3_places import Autd3Place
from midair.devices.arrays.autd3_udp import Autd3Udp
from midair.devices.frame_bytes import Bytes
from midair.errors import DeviceError, LinkLostError, SilentFramesError
from midair.model import Placement

_KEPT = 64
"""Frames of which is known when they left."""


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
        self._number = self._flying = self._round = self._unanswered = 0
        self._wrong: DeviceError | None = None
        self._asks = 0.0
        self._geometry = commands.geometry(placement)
        # Tasks are held here: the loop itself holds them weakly only.
        self._tasks: set[asyncio.Task[None]] = set()
        super().__init__(placement, place, failsafe=failsafe, heartbeat=False)

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Send a frame that sounds from an instant on, and do not wait for it."""
        if self._wrong is not None:
            raise self._wrong
        frame = Frames.encode(self._geometry, Pattern(PhaseBuffer.from_array(phases), intensity))[0]
        number, self._number = self._number, self._number + 1
        self._left[number % _KEPT] = 0
        self._loop.call_soon_threadsafe(self._begin, frame, instant, number, self._round)

    def sent(self, number: int) -> int:
        """When a frame left, in ns of `time.monotonic_ns`; 0 if it did not, or has not yet."""
        return int(self._left[number % _KEPT])

    def told(self) -> dict[str, int]:
        """What became of all frames."""
        return dict(self._told)

    def silence(self) -> None:
        """All transducers to intensity 0 at once; no frame that was put before goes out any more."""
        self._round += 1
        super().silence()

    def _begin(self, frame: Frame, instant: int, number: int, ordered: int) -> None:
        """On the SDK's own loop: send unless it is too late."""
        if ordered != self._round or self._client is None:
            return
        if self._flying >= self._crowd:
            self._told["crowded"] += 1
            return
        if self._client.device_time_now().sys_time >= instant:
            self._told["late"] += 1
            return
        self._flying += 1
        self._start(self._send_frame(frame, instant, number))
        if (now := time.monotonic()) - self._asks > self._asked:
            self._asks = now
            self._start(self._ask())

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _send_frame(self, frame: Frame, instant: int, number: int) -> None:
        try:
            at = ExecAt.At(SysTime.from_nanos(instant))
            answer = await self._open.send_frame_at(frame, at)
            self._left[number % _KEPT] = time.monotonic_ns()
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
        """Ask the units how they are: what their failsafe has silenced nobody feels."""
        try:
            states = await self._open.read_fpga_state()
        except (Autd3Error, DeviceError):
            return  # frames that get no answer say so
        silenced = [unit for unit, state in enumerate(states) if state.is_failsafe_active()]
        if silenced:
            self._wrong = SilentFramesError(
                f"autd3: expected every frame to sound, but the failsafe silenced units {silenced} after "
                f"{self.failsafe:g} s without a frame; look for what held the computer up, then start again"
            )
