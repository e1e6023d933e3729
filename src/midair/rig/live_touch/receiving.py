"""The side that plays: frames from a network as a sensor, each at its time, whatever the way did to them.

A frame waits in the jitter buffer until the fastest frame of the last seconds, plus the length of the buffer, would
have come: so jitter up to that length is not felt. One that has not come by then is concealed: the last one is held.
One that comes after that is thrown away.
"""

import secrets
import socket
import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from midair.devices import Chunk, Stream
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
)

LARGEST = 2048
"""Bytes of a message, at most."""


@dataclass(slots=True)
class PacketCounts:
    """What came over the network, and what became of it.

    Attributes
    ----------
    frames : int
        That came, of this run, for the first time.
    concealed : int
        That had not come when it was their turn: the last one was held.
    tardy : int
        Of them, those that came after their turn.
    repeated : int
        That came a second time, and were refused.
    refused : int
        Messages that did not open, or were of another run.
    """

    frames: int = 0
    concealed: int = 0
    tardy: int = 0
    repeated: int = 0
    refused: int = 0


@dataclass(slots=True, kw_only=True)
class JitterBuffer:
    """Frames in order, each at its time.

    Attributes
    ----------
    rate : float
        Frames per second, in Hz.
    length : float
        In s.
    over : int
        Frames among which the fastest is looked for; after so many a faster one is forgotten, as clocks drift.
    """

    rate: float
    length: float
    over: int = 4000
    counted: PacketCounts = field(default_factory=PacketCounts)
    _waiting: dict[int, np.ndarray] = field(default_factory=dict[int, np.ndarray])
    _fastest: deque[tuple[int, float]] = field(default_factory=deque[tuple[int, float]])
    _next: int = -1
    _last: np.ndarray | None = None

    def put(self, sealed: ReceivedFrame, came: float) -> None:
        """A frame that came at an instant of this computer's clock, in s."""
        if self._next < 0:
            self._next = sealed.number
        self.counted.frames += 1
        # The least of the last frames, kept in order of time and of size.
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
        """When the next frame is to be given, by this computer's clock; never while none has come."""
        if not self._fastest:
            return np.inf
        return self._fastest[0][1] + self._next / self.rate + self.length

    def get(self) -> tuple[int, np.ndarray] | None:
        """The next frame, whose time has come, or the last one in its place; None while none has come at all."""
        number, self._next = self._next, self._next + 1
        pressure = self._waiting.pop(number, None)
        if pressure is None:
            self.counted.concealed += 1
            return None if self._last is None else (number, self._last)
        self._last = pressure
        return number, pressure


class NetworkSource:
    """Waits for one who feels, lets nobody else in, and gives its frames: a `Source` for `StreamedSensor`.

    Parameters
    ----------
    where : tuple of (str, int)
        Address and port to listen at.
    key : bytes
        That both sides share.
    buffer : float
        Length of the jitter buffer, in s.
    patience : float
        How long to wait for a greeting, in s.
    silence : float
        After how long without any frame they are no longer concealed, in s; the loop fades 20 ms after that.
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
        if not 0 <= buffer <= 0.2:
            raise InputError(f"buffer: expected 0 to 200 ms of jitter buffer, got {1e3 * buffer:g} ms")
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
        """At which it listens."""
        return 0 if self._socket is None else int(self._socket.getsockname()[1])

    @property
    def wiring(self) -> SensorWiring:
        """Of the cells that the other side feels with, in Pa."""
        grid = SensorGrid() if self.greeting is None else self.greeting.grid
        return SensorWiring(grid=grid, order=tuple(range(grid.count)), unit="Pa")

    @property
    def delay(self) -> float:
        """Of the other side's filter and of the jitter buffer, in s."""
        return self._length + (0.0 if self.greeting is None else self.greeting.delay)

    def bind(self) -> None:
        """Listen, without waiting for anybody yet.

        Raises
        ------
        DeviceError
            If the address or the port cannot be had.
        """
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
        """Wait for a greeting of one who has the key, and answer it."""
        self.bind()
        until = time.monotonic() + self._patience
        while self.greeting is None:
            if time.monotonic() > until:
                more = f"; {self.counted.refused} messages did not open: another key?" if self.counted.refused else ""
                raise DeviceError(f"live: expected somebody who feels, nobody greeted in {self._patience:g} s{more}")
            self._take(0.1)
        self._buffer = JitterBuffer(rate=self.greeting.rate, length=self._length, counted=self.counted)
        return Stream(channels=self.greeting.grid.count, rate=self.greeting.rate, unit="Pa")

    def start(self) -> None:
        """From the next frame on."""
        if self.greeting is not None:
            self._buffer = JitterBuffer(rate=self.greeting.rate, length=self._length, counted=self.counted)
        self._origin = -1

    def pull(self, wait: float) -> Chunk | None:
        """The next frame when its time has come."""
        buffer, until = self._buffer, time.monotonic() + wait
        if buffer is None:
            raise DeviceStateError("live: expected open before frames")
        while True:
            now = time.monotonic()
            due = buffer.due()
            if due <= now:
                # What has come while this computer was busy has come.
                while self._take(0.0):
                    pass
                now = time.monotonic()
                if now - self._heard > self._silence + self._length:
                    # Nobody speaks: what is held is no longer touch.
                    if self._ended:
                        raise DeviceError("live: the side that feels has ended")
                    return self._quiet(buffer, until)
                got = buffer.get()
                if got is not None:
                    return self._chunk(got, due)
                continue
            if now >= until:
                return None
            self._take(min(due, until) - now)

    def stop(self) -> None:
        """Nothing to stop."""

    def close(self) -> None:
        """Let go of the port."""
        made, self._socket = self._socket, None
        if made is not None:
            made.close()

    def describe(self) -> dict[str, str]:
        """What came, and what became of it."""
        told = self.counted
        return {
            "network": f"{told.frames} frames, {told.concealed} concealed ({told.tardy} came too late), "
            f"{told.repeated} repeated and {told.refused} others refused",
            "jitter buffer": f"{1e3 * self._length:g} ms",
        }

    def _quiet(self, buffer: JitterBuffer, until: float) -> None:
        """Wait for somebody to speak again; frames whose time goes by meanwhile are lost."""
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
        """One message, if one comes in time; whether one came."""
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
            self._greeted(message, sender)
        elif kind == FRAME and self.greeting is not None and self._drawn:
            self._framed(message, came)
        elif kind == END and self._drawn and message == self._drawn:
            self._ended = True
        else:
            self.counted.refused += 1
        return True

    def _greeted(self, message: bytes, sender: object) -> None:
        begun, said = message[:NUMBER], message[NUMBER:]
        if self.greeting is None:
            self.greeting, self._begun, self._drawn = SessionOffer.of(said), begun, secrets.token_bytes(NUMBER)
        elif begun != self._begun:
            # Whoever comes second, or says again what another run began with, is not let in.
            self.counted.refused += 1
            return
        if self._socket is not None:
            answer = self._seal.close(WELCOME, begun + self._drawn)
            self._socket.sendto(answer, sender)  # pyright: ignore[reportArgumentType]

    def _framed(self, message: bytes, came: float) -> None:
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
