"""The playing side of the network: received frames as a sensor with regular timing.

A frame waits in the jitter buffer until the arrival time of the fastest recent frame plus the buffer length, which
hides jitter up to that length. A frame that has not arrived by then is left out and dropped if it arrives later: the
units keep the frame before it, which the loop fades after 20 ms. If the network delay changes, the buffer follows.
"""

import math
import secrets
import socket
import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from midair.devices import Chunk, Source, Stream
from midair.errors import DeviceError, DeviceStateError, InputError
from midair.model import SensorGrid, SensorWiring
from midair.rig.live_touch.encryption import (
    END,
    FRAME,
    HELLO,
    NUMBER,
    WELCOME,
    FrameCipher,
    ReceivedFrame,
    ReplayFilter,
    SessionOffer,
    frame_from,
    run_of,
)

LARGEST = 2048
"""Maximum length of a message in bytes."""


WINDOW = 0.1
"""Time in s over which the network delay is measured."""

SLEW = 4e-6
"""Change of the playout time in s per frame towards the measured delay; the loop's timetable follows it."""

EXCESS = 0.06
"""Surplus delay in s that is removed at once; a timetable starts anew for such a step."""

OFFERS = 64
"""Number of greetings that are remembered until the first frame."""

OTHERS = 500
"""Messages of an unknown sender that are decrypted in a second."""

AHEAD = 4000
"""Number of frames that may wait."""

GONE = 10.0
"""Time in s without a frame after which the sender has ended, if the message of its end was lost."""


@dataclass(slots=True)
class PacketCounts:
    """Counts of received frames and messages."""

    frames: int = 0
    """Frames of this run, without repetitions."""
    concealed: int = 0
    """Frames that had not arrived in time: the frame before them stayed."""
    tardy: int = 0
    """Frames among them that arrived later."""
    repeated: int = 0
    """Frames that arrived a second time, and were refused."""
    refused: int = 0
    """Messages that failed authentication, belong to another run, or exceed the rate limit."""


@dataclass(slots=True, kw_only=True)
class JitterBuffer:
    """Frames in order, each at its time; `rate` in Hz, `length` and `window` in s.

    The way of a frame is its arrival time less its sampling time, up to a constant.
    """

    rate: float
    length: float
    window: float = WINDOW
    counted: PacketCounts = field(default_factory=PacketCounts)
    _waiting: dict[int, np.ndarray] = field(default_factory=dict[int, np.ndarray])
    _came: deque[float] = field(default_factory=deque[float])
    _ways: deque[float] = field(default_factory=deque[float])
    _began: float = np.inf
    _fastest: float = np.inf
    # Way on which the playout times are based; None before the first.
    _way: float | None = None
    _next: int = -1

    def put(self, sealed: ReceivedFrame, came: float) -> None:
        """Add a frame that arrived at `came`, in s of this computer's clock."""
        number, way = sealed.number, came - sealed.number / self.rate
        if self._next < 0:
            self._next, self._began = number, came
        self.counted.frames += 1
        if number < self._next:
            self.counted.tardy += 1
        elif number < self._next + AHEAD:
            self._waiting[number] = sealed.pressure
        self._came.append(came)
        self._ways.append(way)
        while self._came[0] < came - self.window:
            self._came.popleft()
            self._ways.popleft()
        self._fastest = min(self._ways)
        if self._way is None:
            if came - self._began >= self.window:
                self._follow(self._fastest, came)
        elif way > self._way + self.length:
            self._follow_late_frames(came)
        elif self._way - self._fastest > EXCESS:
            self._follow(self._fastest, came)

    def due(self) -> float:
        """Time of the next frame by this computer's clock; infinite in the first window."""
        return np.inf if self._way is None else self._way + self._next / self.rate + self.length

    def get(self) -> tuple[int, np.ndarray | None]:
        """Return the number of the next frame and its pressure; None for a frame that has not arrived."""
        number, self._next = self._next, self._next + 1
        if self._way is not None:
            self._way += min(max(self._fastest - self._way, -SLEW), SLEW)
        pressure = self._waiting.pop(number, None)
        self.counted.concealed += pressure is None
        return number, pressure

    @property
    def empty(self) -> bool:
        """Whether no frame waits."""
        return not self._waiting

    def _follow_late_frames(self, came: float) -> None:
        """Follow a longer way if most frames of a window are late; frames that arrive all at once are no longer way."""
        latest = (self._way or 0.0) + self.length
        half = [way for at, way in zip(self._came, self._ways, strict=True) if at > came - self.window / 2]
        late = sum(way > latest for way in self._ways)
        if late > len(self._ways) / 2 and came - self._came[0] > self.window / 2:
            self._follow(min(half), came)

    def _follow(self, way: float, came: float) -> None:
        """Base the playout times on another way, and leave out frames whose time is over."""
        first = max(self._next, math.ceil((came - way - self.length) * self.rate))
        self.counted.concealed += 0 if self._way is None else first - self._next
        self._waiting = {number: pressure for number, pressure in self._waiting.items() if number >= first}
        self._way, self._next = way, first


class RateLimit:
    """Accepts so many messages of each sender in a second, so that a flood is not decrypted."""

    def __init__(self) -> None:
        self._began, self._seen = -np.inf, dict[object, int]()

    def accepts(self, sender: object, most: float, now: float) -> bool:
        """Whether a sender's message is among the first `most` of this second."""
        if now - self._began > 1:
            self._began = now
            self._seen.clear()
        self._seen[sender] = self._seen.get(sender, 0) + 1
        return self._seen[sender] <= most


class NetworkSource(Source):
    """Waits for the first frame of an authenticated sender and gives its frames: a `Source` for `StreamedSensor`.

    Every greeting is answered with a random number of its own; only a frame that carries one of these numbers selects
    the run, since anybody can repeat a recorded greeting. Other runs are refused from then on. `buffer` is the length
    of the jitter buffer and `patience` the longest wait for the first frame, both in s.
    """

    def __init__(self, where: tuple[str, int], key: bytes, *, buffer: float = 0.01, patience: float = 60.0) -> None:
        self._where, self._seal, self._length, self._patience = where, FrameCipher(key), buffer, patience
        self._drawn, self._origin = b"", -1
        self._socket: socket.socket | None = None
        self.greeting: SessionOffer | None = None
        # Greeting and offer of each run that may begin, by the number drawn for it.
        self._offers: dict[bytes, tuple[bytes, SessionOffer]] = {}
        self._sender: object = None
        self._buffer: JitterBuffer | None = None
        self._once, self._limit = ReplayFilter(), RateLimit()
        # Time of the end of sending, and of the last frame; frames sent before may still arrive.
        self._ended, self._came = np.inf, np.inf
        self._unfit = ""
        self.counted = PacketCounts()

    @property
    def port(self) -> int:
        """Port at which it listens."""
        return 0 if self._socket is None else int(self._socket.getsockname()[1])

    @property
    def wiring(self) -> SensorWiring:
        """Wiring of the sender's cells, in Pa."""
        grid = SensorGrid() if self.greeting is None else self.greeting.grid
        return SensorWiring(grid=grid, order=tuple(range(grid.count)), unit="Pa")

    @property
    def delay(self) -> float:
        """Delay of the sender's filter and of the jitter buffer in s."""
        return self._length + (0.0 if self.greeting is None else self.greeting.delay)

    def bind(self) -> None:
        """Open the port without waiting for a sender; DeviceError if address or port is not available."""
        if self._socket is not None:
            return
        family = socket.AF_INET6 if ":" in self._where[0] else socket.AF_INET
        made = socket.socket(family, socket.SOCK_DGRAM)
        try:
            made.bind(self._where)
        except OSError as wrong:
            made.close()
            raise DeviceError(f"--listen {self._where[0]}:{self._where[1]}: {wrong.strerror}") from wrong
        self._socket = made

    def open(self) -> Stream:
        """Answer greetings of senders with the key until one of them sends a frame."""
        self.bind()
        until = time.monotonic() + self._patience
        while self.greeting is None:
            if time.monotonic() > until:
                refused = f"; {self.counted.refused} messages were refused: check the key"
                more = f"; {self._unfit}" if self._unfit else refused if self.counted.refused else ""
                raise DeviceError(f"live: expected frames of a sender, got none in {self._patience:g} s{more}")
            self._take(0.1)
        return Stream(channels=self.greeting.grid.count, rate=self.greeting.rate, unit="Pa")

    def start(self) -> None:
        """Begin with the next frame; those that arrived since `open` are old."""
        self._buffer, self._origin = None, -1
        self._take_all()
        if self.greeting is not None:
            self._buffer = JitterBuffer(rate=self.greeting.rate, length=self._length, counted=self.counted)

    def pull(self, wait: float) -> Chunk | None:
        """Return the next frame at its time; frames that did not arrive by then are left out."""
        buffer, until = self._buffer, time.monotonic() + wait
        if buffer is None:
            raise DeviceStateError("live: expected an open source before reading frames")
        while True:
            if buffer.due() <= time.monotonic():
                # Read all messages that arrived while this computer was busy; they may move the time.
                self._take_all()
            now, due = time.monotonic(), buffer.due()
            # After the end, only frames that were sent before it may be missing.
            over = now > self._ended and buffer.empty
            if due <= now and not over:
                number, pressure = buffer.get()
                if pressure is not None:
                    if self._origin < 0:
                        self._origin = number
                    first, rate = number - self._origin, 1.0 if self.greeting is None else self.greeting.rate
                    return Chunk(samples=pressure[None], first=first, device_time=number / rate, host_time=due)
            elif over and now > self._ended + WINDOW:
                raise DeviceError("live: the sender has ended")
            elif now > self._came + GONE:
                raise DeviceError(f"live: expected frames of the sender, got none for {GONE:g} s; start it again there")
            elif now >= until:
                return None
            else:
                self._take((until if over else min(due, until)) - now)

    def close(self) -> None:
        """Close the port."""
        made, self._socket = self._socket, None
        if made is not None:
            made.close()

    def describe(self) -> dict[str, str]:
        """Counts of received frames."""
        told = self.counted
        return {
            "network": f"{told.frames} frames, {told.concealed} concealed ({told.tardy} came too late), "
            f"{told.repeated} repeated and {told.refused} others refused",
            "jitter buffer": f"{1e3 * self._length:g} ms",
        }

    def _take_all(self) -> None:
        """Process the messages that wait; their number is limited, since a flood has no end."""
        for _ in range(1000):
            if not self._take(0.0):
                return

    def _take(self, wait: float) -> bool:
        """Process one message if one arrives in time; return whether one arrived."""
        made = self._socket
        if made is None:
            return False
        made.settimeout(max(0.0, wait))
        try:
            box, sender = made.recvfrom(LARGEST)
        except OSError:
            return False
        came = time.monotonic()
        # All others share one limit once the sender is known.
        known, most = sender == self._sender, OTHERS
        if known and self.greeting is not None:
            most += 4 * self.greeting.rate
        opened = None
        if self._limit.accepts(sender if known or self._sender is None else None, most, came):
            opened = self._seal.open(box)
        kind, message = opened or (b"", b"")
        if kind == HELLO:
            self._answer(message, sender)
        elif kind == FRAME:
            self._accept_frame(message, sender, came)
        elif kind == END and self._drawn and message == self._drawn:
            self._ended = min(self._ended, came)
        else:
            self.counted.refused += 1
        return True

    def _answer(self, message: bytes, sender: object) -> None:
        """Answer a greeting; after the first frame only the same run is answered."""
        begun = message[:NUMBER]
        drawn = next((drawn for drawn, (known, _) in self._offers.items() if known == begun), b"")
        if not drawn:
            try:
                offer = None if self._drawn else SessionOffer.of(message[NUMBER:])
            except InputError as wrong:
                self._unfit, offer = str(wrong), None
            if offer is None:
                self.counted.refused += 1
                return
            drawn = secrets.token_bytes(NUMBER)
            self._offers[drawn] = begun, offer
            if len(self._offers) > OFFERS:
                del self._offers[next(iter(self._offers))]
        if self._socket is not None:
            answer = self._seal.close(WELCOME, begun + drawn)
            self._socket.sendto(answer, sender)  # pyright: ignore[reportArgumentType]

    def _accept_frame(self, message: bytes, sender: object, came: float) -> None:
        drawn = self._drawn or run_of(message)
        offer = self._offers.get(drawn)
        sealed = None if offer is None else frame_from(message, offer[1].grid.count, drawn)
        if sealed is None or offer is None:
            self.counted.refused += 1
            return
        if not self._once.first(sealed.number):
            self.counted.repeated += 1
            return
        self._drawn, self._offers, self._sender, self.greeting = drawn, {drawn: offer}, sender, offer[1]
        self._came = came
        if self._buffer is None:
            self.counted.frames += 1
        else:
            self._buffer.put(sealed, came)
