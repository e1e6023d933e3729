"""The playing side of the network: received frames as a sensor with regular timing.

A frame waits in the jitter buffer until the arrival time of the fastest recent frame plus the buffer length, which
hides jitter up to that length. A frame that has not arrived by then is concealed by the last one, and dropped if it
arrives later.
"""

import secrets
import socket
import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from midair.devices import Chunk, Stream
from midair.errors import DeviceError, DeviceStateError
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
)

LARGEST = 2048
"""Maximum length of a message in bytes."""


@dataclass(slots=True)
class PacketCounts:
    """Counts of received frames and messages."""

    frames: int = 0
    """Frames of this run, without repetitions."""
    concealed: int = 0
    """Frames that had not arrived in time, replaced by the last one."""
    tardy: int = 0
    """Frames among them that arrived later."""
    repeated: int = 0
    """Frames that arrived a second time, and were refused."""
    refused: int = 0
    """Messages that failed authentication or belong to another run."""


@dataclass(slots=True, kw_only=True)
class JitterBuffer:
    """Frames in order, each at its time; `rate` in Hz, `length` in s."""

    rate: float
    length: float
    over: int = 4000
    """Number of frames for which the fastest arrival is remembered, as clocks drift."""
    counted: PacketCounts = field(default_factory=PacketCounts)
    _waiting: dict[int, np.ndarray] = field(default_factory=dict[int, np.ndarray])
    _fastest: deque[tuple[int, float]] = field(default_factory=deque[tuple[int, float]])
    _next: int = -1
    _last: np.ndarray | None = None

    def put(self, sealed: ReceivedFrame, came: float) -> None:
        """Add a frame that arrived at `came`, in s of this computer's clock."""
        if self._next < 0:
            self._next = sealed.number
        self.counted.frames += 1
        # Sliding minimum over the last frames.
        way = came - sealed.number / self.rate
        while self._fastest and self._fastest[-1][1] >= way:
            self._fastest.pop()
        self._fastest.append((sealed.number, way))
        while self._fastest[0][0] < sealed.number - self.over:
            self._fastest.popleft()
        if sealed.number < self._next:
            self.counted.tardy += 1
        elif sealed.number < self._next + self.over:
            self._waiting[sealed.number] = sealed.pressure

    def due(self) -> float:
        """Time of the next frame by this computer's clock; infinite before the first."""
        if not self._fastest:
            return np.inf
        return self._fastest[0][1] + self._next / self.rate + self.length

    def get(self) -> tuple[int, np.ndarray] | None:
        """Return the next frame, or the last one in its place; None before the first."""
        number, self._next = self._next, self._next + 1
        pressure = self._waiting.pop(number, None)
        if pressure is None:
            self.counted.concealed += 1
            return None if self._last is None else (number, self._last)
        self._last = pressure
        return number, pressure


class NetworkSource:
    """Waits for one authenticated sender, refuses others, and gives its frames: a `Source` for `StreamedSensor`.

    `buffer` is the length of the jitter buffer, `patience` the longest wait for a greeting, and `silence` the time
    without any frame after which concealment ends (the loop fades 20 ms later), all in s.
    """

    def __init__(
        self,
        where: tuple[str, int],
        key: bytes,
        *,
        buffer: float = 0.01,
        patience: float = 60.0,
        silence: float = 0.02,
    ) -> None:
        self._where, self._seal, self._length, self._patience = where, FrameCipher(key), buffer, patience
        self._silence = silence
        self._drawn, self._origin = b"", -1
        self._socket: socket.socket | None = None
        self.greeting: SessionOffer | None = None
        self._begun: bytes = b""
        self._buffer: JitterBuffer | None = None
        self._once = ReplayFilter()
        self._heard = -np.inf
        self._ended = False
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
        """Wait for a greeting from a sender with the key, and answer it."""
        self.bind()
        until = time.monotonic() + self._patience
        while self.greeting is None:
            if time.monotonic() > until:
                more = (
                    f"; {self.counted.refused} messages failed authentication: check the key"
                    if self.counted.refused
                    else ""
                )
                raise DeviceError(f"live: expected a greeting of a sender, got none in {self._patience:g} s{more}")
            self._take(0.1)
        self._buffer = JitterBuffer(rate=self.greeting.rate, length=self._length, counted=self.counted)
        return Stream(channels=self.greeting.grid.count, rate=self.greeting.rate, unit="Pa")

    def start(self) -> None:
        """Begin with the next frame."""
        if self.greeting is not None:
            self._buffer = JitterBuffer(rate=self.greeting.rate, length=self._length, counted=self.counted)
        self._origin = -1

    def pull(self, wait: float) -> Chunk | None:
        """Return the next frame at its time."""
        buffer, until = self._buffer, time.monotonic() + wait
        if buffer is None:
            raise DeviceStateError("live: expected an open source before reading frames")
        while True:
            now = time.monotonic()
            due = buffer.due()
            if due <= now:
                # Read all messages that arrived while this computer was busy.
                while self._take(0.0):
                    pass
                now = time.monotonic()
                if now - self._heard > self._silence + self._length:
                    # The sender is silent: a repeated frame would no longer be touch.
                    if self._ended:
                        raise DeviceError("live: the sender has ended")
                    return self._wait_for_frames(buffer, until)
                got = buffer.get()
                if got is not None:
                    return self._chunk(got, due)
                continue
            if now >= until:
                return None
            self._take(min(due, until) - now)

    def stop(self) -> None:
        """Do nothing."""

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

    def _wait_for_frames(self, buffer: JitterBuffer, until: float) -> None:
        """Wait until frames arrive again; frames whose time passes meanwhile are lost."""
        while time.monotonic() < until and time.monotonic() - self._heard > self._silence + self._length:
            self._take(max(0.0, min(0.005, until - time.monotonic())))
        if time.monotonic() - self._heard <= self._silence + self._length:
            while buffer.due() <= time.monotonic() - 1 / buffer.rate:
                buffer.get()

    def _chunk(self, got: tuple[int, np.ndarray], due: float) -> Chunk:
        number, pressure = got
        if self._origin < 0:
            self._origin = number
        first, rate = number - self._origin, 1.0 if self.greeting is None else self.greeting.rate
        return Chunk(samples=pressure[None], first=first, device_time=number / rate, host_time=due)

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
        opened = self._seal.open(box)
        kind, message = opened or (b"", b"")
        if kind == HELLO:
            self._accept_greeting(message, sender)
        elif kind == FRAME and self.greeting is not None and self._drawn:
            self._accept_frame(message, came)
        elif kind == END and self._drawn and message == self._drawn:
            self._ended = True
        else:
            self.counted.refused += 1
        return True

    def _accept_greeting(self, message: bytes, sender: object) -> None:
        begun, said = message[:NUMBER], message[NUMBER:]
        if self.greeting is None:
            self.greeting, self._begun, self._drawn = SessionOffer.of(said), begun, secrets.token_bytes(NUMBER)
        elif begun != self._begun:
            # A second sender, or a replayed greeting of another run, is refused.
            self.counted.refused += 1
            return
        if self._socket is not None:
            answer = self._seal.close(WELCOME, begun + self._drawn)
            self._socket.sendto(answer, sender)  # pyright: ignore[reportArgumentType]

    def _accept_frame(self, message: bytes, came: float) -> None:
        channels = 0 if self.greeting is None else self.greeting.grid.count
        sealed = frame_from(message, channels, self._drawn)
        if sealed is None:
            self.counted.refused += 1
            return
        if not self._once.first(sealed.number):
            self.counted.repeated += 1
            return
        self._heard = came
        if self._buffer is not None:
            self._buffer.put(sealed, came)
