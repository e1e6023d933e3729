"""Who may sound, until when: a few words of memory that the one who permits and the one who plays share.

Whoever is responsible renews the permit as long as somebody looks on; whoever plays looks at it before every frame or
switch of banks. Nothing has to arrive for silence: a permit that nobody renews runs out by itself, in a process that
hangs or died too.
"""

import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Literal, Protocol, cast

from midair.devices import uptime
from midair.errors import DeviceStateError, InputError, MidairError, StoppedError

Refusal = Literal["stopped", "expired", "disarmed"]
"""Why nothing may sound: somebody asked for silence; nobody renewed it in time; it is not, or no longer, armed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaseToken:
    """What one arming allows, handed to the one who plays: with it, `PlayLease.refusal` tells whether it still holds.

    Attributes
    ----------
    number : int
        Number of the arming, from 1 on.
    stops : int
        How often silence had been asked for before it.
    """

    number: int
    stops: int


class PlayLease:
    """Deadline, arming, stops and level, in memory that a process shares with those that it starts.

    Give it to a process as an argument of `multiprocessing.Process` (or of the spawn context's): the memory has no name
    and no file, so that nothing of it is left when its processes are gone. Every word has one writer: the holder (who
    makes it, arms and renews) or the player; a word is written in one piece.

    Parameters
    ----------
    clock : callable
        Seconds, by a clock that all processes of this computer share, which goes on while it sleeps.

    Examples
    --------
    >>> permit = Permit()
    >>> leave = permit.arm(0.5)
    >>> permit.refusal(leave) is None, permit.level
    (True, 0.5)
    >>> permit.stop()
    >>> permit.refusal(leave)
    'stopped'
    """

    def __init__(self, clock: Callable[[], float] = uptime) -> None:
        # Without a lock: a holder that is halted inside one would hold up the player.
        self._words = cast("_Words", get_context("spawn").RawArray("d", len(_PLACES)))
        self._clock = clock
        self._here: Literal["holder", "player"] = "holder"

    def __getstate__(self) -> dict[str, object]:
        """What another process gets: the same memory, in which it writes the player's words."""
        return {"_words": self._words, "_clock": self._clock, "_here": "player"}

    @property
    def level(self) -> float:
        """How loud it may be now, 0 to 1 of what was admitted; 0 where nothing may sound."""
        return self._get("level") if self._get("armed") else 0.0

    @property
    def armed(self) -> bool:
        """Whether something may sound now."""
        return self._get("armed") > 0 and self._clock() < self._get("deadline") and self.stops == self._get("base")

    @property
    def stops(self) -> int:
        """How often silence was asked for, by whomever."""
        return int(self._get("stops_by_holder") + self._get("stops_by_player"))

    @property
    def left(self) -> float:
        """Time until it runs out, in s; 0 where nothing may sound."""
        return max(0.0, self._get("deadline") - self._clock()) if self.armed else 0.0

    def arm(self, level: float = 1.0, *, lasts: float = 0.5) -> LeaseToken:
        """Permit sound up to a level for a while; what was armed before is over.

        Parameters
        ----------
        level : float
            0 to 1 of what was admitted; `turn` can lower it and bring it back, and never goes beyond.
        lasts : float
            Time until it runs out unless renewed, in s.

        Raises
        ------
        InputError
            If level or time is out of range.
        DeviceStateError
            If this is the player's end of it.
        """
        self._holding("arm")
        _within(level, "level", 1.0)
        _within(lasts, "lasts", 10.0)
        self._put("armed", 0.0)
        stops = self.stops
        number = int(self._get("armings")) + 1
        self._put("armings", number)
        self._put("base", stops)
        self._put("ceiling", level)
        self._put("level", level)
        self._put("deadline", self._clock() + lasts)
        # Last of all: only now all the others are those of this arming.
        self._put("armed", number)
        return LeaseToken(number=number, stops=stops)

    def renew(self, *, lasts: float = 0.5) -> bool:
        """Somebody still looks on: move the deadline; False, and disarmed, where it has run out or was stopped."""
        self._holding("renew")
        _within(lasts, "lasts", 10.0)
        if not self.armed:
            # A deadline that was missed is not made good: whoever plays may have found out, and ends.
            self.disarm()
            return False
        self._put("deadline", self._clock() + lasts)
        return True

    def turn(self, level: float) -> None:
        """Set the level, up to that of the arming.

        Raises
        ------
        InputError
            If it is louder than was armed: that has to be admitted, and armed, anew.
        """
        self._holding("turn")
        _within(level, "level", self._get("ceiling"))
        self._put("level", level)

    def disarm(self) -> None:
        """Nothing may sound any more, until it is armed again."""
        self._holding("disarm")
        self._put("armed", 0.0)
        self._put("level", 0.0)

    def stop(self) -> None:
        """Silence, from either end: what was armed is over, whatever is renewed."""
        mine = "stops_by_holder" if self._here == "holder" else "stops_by_player"
        self._put(mine, self._get(mine) + 1)
        if self._here == "holder":
            self.disarm()

    def refusal(self, leave: LeaseToken) -> Refusal | None:
        """Why nothing may sound by an arming; None where it may."""
        if self.stops != leave.stops:
            return "stopped"
        if self._get("armed") != leave.number:
            return "disarmed"
        return "expired" if self._clock() >= self._get("deadline") else None

    def check(self, leave: LeaseToken, name: str = "array") -> None:
        """Raise StoppedError where nothing may sound by an arming."""
        refusal = self.refusal(leave)
        if refusal is not None:
            raise StoppedError(f"{name}: {_SAID[refusal]}")

    def _holding(self, what: str) -> None:
        if self._here != "holder":
            raise DeviceStateError(f"permit: expected its holder to {what}, got the player, who can only stop")

    def _get(self, word: str) -> float:
        return self._words[_PLACES[word]]

    def _put(self, word: str, value: float) -> None:
        self._words[_PLACES[word]] = value


class LeaseGuard(Protocol):
    """What looks at a permit before it lets sound begin or go on, as `ArrayDevice` does."""

    name: str

    def allowing(self, check: Callable[[], None] | None) -> None:
        """Have something called before every frame or switch, which raises where nothing may sound."""
        ...

    def silence(self) -> None:
        """Stop all sound at once, from any thread."""
        ...


@contextmanager
def under_lease(array: LeaseGuard, permit: PlayLease, leave: LeaseToken, *, every: float = 0.005) -> Generator[None]:
    """While inside, an array lets nothing sound without this arming, and is silenced as soon as it is over.

    The array looks itself before every frame or switch; and since a switch may hand over a quarter of a second, a
    thread looks as well, as often as `every` says, in s.

    Raises
    ------
    StoppedError
        From what plays inside.
    """
    left = threading.Event()

    def watch() -> None:
        while not left.wait(every):
            if permit.refusal(leave) is not None:
                # What cannot be told to be silent says so to whoever plays on it.
                with suppress(MidairError):
                    array.silence()
                return

    array.allowing(lambda: permit.check(leave, array.name))
    watching = threading.Thread(target=watch, name="permit", daemon=True)
    watching.start()
    try:
        yield
    finally:
        left.set()
        watching.join()
        array.allowing(None)


class _Words(Protocol):
    """What is used of the shared array of numbers."""

    def __getitem__(self, place: int) -> float: ...

    def __setitem__(self, place: int, value: float) -> None: ...


_PLACES = {
    word: place
    for place, word in enumerate(
        ("deadline", "armed", "armings", "base", "level", "ceiling", "stops_by_holder", "stops_by_player")
    )
}
"""Where each word is; `stops_by_player` alone is the player's to write. Eight numbers of eight bytes, all aligned."""

_SAID: dict[Refusal, str] = {
    "stopped": "somebody asked for silence; start again when it is safe",
    "expired": "silenced, for nobody looked on in time: the page or program was closed, hidden, hung or kept waiting by"
    " others on this computer; start again",
    "disarmed": "expected an armed permit; it was taken back",
}


def _within(value: float, name: str, most: float) -> None:
    if not 0 < value <= most:
        raise InputError(f"{name}: expected more than 0 and at most {most:g}, got {value:g}")
