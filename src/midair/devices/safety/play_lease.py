"""A time-limited permission to play, held in memory that the holder and the player share.

The holder renews the lease as long as its user interface is active; the player checks it before every frame or bank
switch. Silence needs no message: without renewal the lease expires, also when the holder's process hangs or has died.
"""

import ctypes
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.sharedctypes import RawValue
from typing import Any, Literal, Protocol

from midair.devices.safety.stop_channel import uptime
from midair.errors import DeviceStateError, InputError, MidairError, StoppedError

Refusal = Literal["stopped", "expired", "disarmed"]
"""Why playing is not allowed: stop was requested; the lease was not renewed in time; it is not, or no longer, armed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaseToken:
    """Identifies one arming of a lease; the player passes it to `PlayLease.refusal`."""

    number: int
    """Number of the arming, from 1."""
    stops: int
    """Number of stop requests before the arming."""


class _Fields(ctypes.Structure):
    """Eight aligned numbers of eight bytes; the player writes `stops_by_player` alone."""

    _fields_ = tuple(
        (name, ctypes.c_double)
        for name in ("deadline", "armed", "armings", "base", "level", "ceiling", "stops_by_holder", "stops_by_player")
    )


class PlayLease:
    """Deadline, arming, stop counts and level, in memory that a process shares with its child processes.

    Pass it to a process as an argument of `start_process`: the memory has no name and no file, so nothing remains when
    its processes have ended. Each field has one writer, the holder (the process that makes, arms and renews the lease)
    or the player, and is written atomically.

    `clock` returns the time in s, is shared by all processes of this computer, and keeps running during sleep mode.

    Examples
    --------
    >>> lease = PlayLease()
    >>> token = lease.arm(0.5)
    >>> lease.refusal(token) is None, lease.level
    (True, 0.5)
    >>> lease.stop()
    >>> lease.refusal(token)
    'stopped'
    """

    def __init__(self, clock: Callable[[], float] = uptime) -> None:
        # Without a lock: a holder that is suspended while it has the lock would block the player.
        self._fields: Any = RawValue(_Fields)
        self._clock = clock
        self._here: Literal["holder", "player"] = "holder"

    def __getstate__(self) -> dict[str, object]:
        """State for another process: the same memory, with the role of the player."""
        return {"_fields": self._fields, "_clock": self._clock, "_here": "player"}

    @property
    def level(self) -> float:
        """Current level, 0 to 1 of the cleared level; 0 where playing is not allowed."""
        return self._fields.level if self._fields.armed else 0.0

    @property
    def armed(self) -> bool:
        """Whether playing is allowed now."""
        return self._fields.armed > 0 and self._clock() < self._fields.deadline and self.stops == self._fields.base

    @property
    def stops(self) -> int:
        """Number of stop requests by holder and player."""
        return int(self._fields.stops_by_holder + self._fields.stops_by_player)

    @property
    def left(self) -> float:
        """Remaining time in s; 0 where playing is not allowed."""
        return max(0.0, self._fields.deadline - self._clock()) if self.armed else 0.0

    def arm(self, level: float = 1.0, *, lasts: float = 0.5) -> LeaseToken:
        """Allow playing for `lasts` s up to a level, 0 to 1 of the cleared one; an earlier arming ends.

        `renew` extends the time. `turn` can lower the level and raise it again, but not above this one. InputError if
        level or time is out of range, DeviceStateError if called by the player.
        """
        self._require_holder("arm")
        _check_range(level, "level", 1.0)
        _check_range(lasts, "lasts", 10.0)
        self._fields.armed = 0.0
        stops = self.stops
        number = int(self._fields.armings) + 1
        self._fields.armings = number
        self._fields.base = stops
        self._fields.ceiling = level
        self._fields.level = level
        self._fields.deadline = self._clock() + lasts
        # Last, since only now all other fields are those of this arming.
        self._fields.armed = number
        return LeaseToken(number=number, stops=stops)

    def renew(self, *, lasts: float = 0.5) -> bool:
        """Move the deadline; return False, and disarm, if the lease has expired or was stopped."""
        self._require_holder("renew")
        _check_range(lasts, "lasts", 10.0)
        if not self.armed:
            # A missed deadline cannot be renewed: the player may have noticed it and is ending.
            self.disarm()
            return False
        self._fields.deadline = self._clock() + lasts
        return True

    def turn(self, level: float) -> None:
        """Set the level, up to that of the arming; InputError above it, which needs a new exposure check and arming."""
        self._require_holder("turn")
        _check_range(level, "level", self._fields.ceiling)
        self._fields.level = level

    def disarm(self) -> None:
        """Forbid playing until the lease is armed again."""
        self._require_holder("disarm")
        self._fields.armed = 0.0
        self._fields.level = 0.0

    def stop(self) -> None:
        """Request silence, from either side: the arming ends and cannot be renewed."""
        if self._here == "player":
            self._fields.stops_by_player += 1
            return
        self._fields.stops_by_holder += 1
        self.disarm()

    def refusal(self, token: LeaseToken) -> Refusal | None:
        """Reason why playing is not allowed under a token; None where it is allowed."""
        if self.stops != token.stops:
            return "stopped"
        if self._fields.armed != token.number:
            return "disarmed"
        return "expired" if self._clock() >= self._fields.deadline else None

    def check(self, token: LeaseToken, name: str = "array") -> None:
        """Raise StoppedError where playing is not allowed under a token."""
        refusal = self.refusal(token)
        if refusal is not None:
            raise StoppedError(f"{name}: {_REASONS[refusal]}")

    def _require_holder(self, what: str) -> None:
        if self._here != "holder":
            raise DeviceStateError(f"lease: expected its holder to {what}, got the player, which can only stop")


class SilencedArray(Protocol):
    """Part of an array that a lease calls, see `ArrayDevice`."""

    name: str

    def allowing(self, check: Callable[[], None] | None) -> None:
        """Set what is called before every frame."""

    def silence(self) -> None:
        """Stop all sound."""


@contextmanager
def under_lease(array: SilencedArray, lease: PlayLease, token: LeaseToken, *, every: float = 0.005) -> Generator[None]:
    """Inside the context, an array plays only under this token; StoppedError as soon as the lease ends.

    The array checks the lease before every frame or bank switch. Since a switch may hand over a quarter of a second of
    frames, a thread checks it as well, every `every` seconds, and silences the array.
    """
    left = threading.Event()

    def watch() -> None:
        while not left.wait(every):
            if lease.refusal(token) is not None:
                # An array that cannot be silenced raises the error in the playing thread.
                with suppress(MidairError):
                    array.silence()
                return

    array.allowing(lambda: lease.check(token, array.name))
    watching = threading.Thread(target=watch, name="lease", daemon=True)
    watching.start()
    try:
        yield
    finally:
        left.set()
        watching.join()
        array.allowing(None)


_REASONS: dict[Refusal, str] = {
    "stopped": "stopped on request; start again when it is safe",
    "expired": "stopped, since the page or program did not renew its permission in time (it was closed, hidden, hung "
    "or delayed by other programs); start again",
    "disarmed": "stopped: its permission to play has ended; play again",
}


def _check_range(value: float, name: str, most: float) -> None:
    if not 0 < value <= most:
        raise InputError(f"{name}: expected more than 0 and at most {most:g}, got {value:g}")
