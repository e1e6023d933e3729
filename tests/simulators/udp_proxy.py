"""A proxy in front of AUTD3's emulator that records every datagram and can query the units.

Needs the extra `autd3`, imported when a tap is created.
"""

import itertools
import random
import select
import socket
import threading
import time
from collections.abc import Container
from typing import Any

FRAME = 0
"""Kind of a datagram that contains a command; other kinds keep the link alive."""
READ_STATE = 0xE7
"""Command that reads the FPGA state of a unit."""
THERMAL = 0x01
"""Bit of the FPGA state: the unit is too hot."""


class UdpProxy:
    """A proxy between a client and `units` emulated units, at `address`; it forwards and records datagrams.

    Header of a datagram: version, kind, message id (2 bytes); of a frame also: sequence number, command. `sent`
    holds (time in s, unit's port, datagram) of all datagrams from the client; `lost` counts those that were
    dropped, by `lose` or at random by the share `loss`, in both directions. `passes` set to False blocks all, and
    `twice` set to True forwards each of the client's twice, as a loop in the network does. `hot` are the ports of
    units that report overheating; `range(65536)` means all.
    """

    def __init__(self, units: int, *, loss: float = 0.0, seed: int = 1) -> None:
        from autd3 import UdpEmulator

        self.loss, self._random = loss, random.Random(seed)

        self.units = units
        self.emulator: Any = UdpEmulator(units)
        group = int(str(self.emulator.option().iface).split('"')[1].rsplit(":", 1)[1])
        self.inner, self.outer = _socket(), {group: _socket()}
        self.address = f"[::1]:{self.outer[group].getsockname()[1]}"
        self.client: Any = None
        self.passes, self.twice = True, False
        self.hot: Container[int] = ()
        self._asked: set[tuple[int, bytes]] = set()
        self._lose: list[tuple[int, bool]] = []
        self._unanswered: set[tuple[int, bytes]] = set()
        self.lost = 0
        self.sent: list[tuple[float, int, bytes]] = []
        self.answers: dict[int, bytes] = {}
        self.sequence: dict[int, int] = {}
        self._ends = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ends = True
        self._thread.join(2)
        for each in (self.inner, *self.outer.values()):
            each.close()

    def lose(self, command: int, *, answer: bool = False) -> None:
        """Drop the next datagram with a command, or only the unit's answer to it."""
        self._lose.append((command, answer))

    def frames(self) -> list[tuple[float, int, int, bytes]]:
        """(time, unit's port, command, datagram) of every command from the client."""
        return [(at, port, datagram[5], datagram) for at, port, datagram in self.sent if datagram[1] == FRAME]

    def gap(self, since: float) -> float:
        """Longest time in s without a datagram from the client after `since`."""
        times = [at for at, _, _ in self.sent if at >= since]
        return max(late - early for early, late in itertools.pairwise(times))

    def states(self) -> list[int]:
        """FPGA state of every unit, queried with the client's next sequence number."""
        self.answers.clear()
        limit = time.monotonic() + 2
        while len(self.answers) < len(self.sequence) and time.monotonic() < limit:
            for port, last in self.sequence.items():
                if port not in self.answers:
                    self.sequence[port] = (last + 1) % 256
                    question = bytes([3, FRAME, 0xFF, 0xFF, self.sequence[port], READ_STATE, 0, 0, 0, 0])
                    self.inner.sendto(question, ("::1", port))
            until = time.monotonic() + 0.2
            while len(self.answers) < len(self.sequence) and time.monotonic() < until:
                time.sleep(0.002)
        return [self.answers[port][-1] for port in sorted(self.answers)]

    def _run(self) -> None:
        while not self._ends:
            facing = {each: port for port, each in self.outer.items()}
            for ready in select.select([self.inner, *facing], [], [], 0.02)[0]:
                datagram, source = ready.recvfrom(65536)
                if self._random.random() < self.loss:
                    self.lost += 1
                elif ready is self.inner:
                    self._back(datagram, source[1])
                else:
                    self._forth(datagram, source, facing[ready])

    def _back(self, datagram: bytes, port: int) -> None:
        if port not in self.outer:
            self.outer[port] = _socket()
        # Answers to the tap's own queries (message id 0xFFFF) are not forwarded.
        if datagram[1] == FRAME and datagram[2:4] == b"\xff\xff":
            # Status 0: accepted; a query with a wrong sequence number is rejected without a state.
            if datagram[5] == 0:
                self.answers[port] = datagram
        elif (port, datagram[2:4]) in self._unanswered:
            self._unanswered.remove((port, datagram[2:4]))
            self.lost += 1
        elif self.client and self.passes:
            if (port, datagram[2:4]) in self._asked and datagram[1] == FRAME:
                self._asked.remove((port, datagram[2:4]))
                if port in self.hot:
                    datagram = datagram[:-1] + bytes([datagram[-1] | THERMAL])
            self.outer[port].sendto(datagram, self.client)

    def _forth(self, datagram: bytes, source: Any, port: int) -> None:
        self.client = source
        self.sent.append((time.monotonic(), port, datagram))
        command = datagram[5] if datagram[1] == FRAME else -1
        if command == READ_STATE:
            self._asked.add((port, datagram[2:4]))
        if (command, True) in self._lose:
            self._lose.remove((command, True))
            self._unanswered.add((port, datagram[2:4]))
        if (command, False) in self._lose:
            self._lose.remove((command, False))
            self.lost += 1
            return
        if datagram[1] == FRAME and self.passes:
            self.sequence[port] = datagram[4]
        for _ in range(self.passes + (self.passes and self.twice)):
            self.inner.sendto(datagram, ("::1", port))


def _socket() -> socket.socket:
    one = socket.socket(socket.AF_INET6, socket.SOCK_DGRAM)
    one.bind(("::1", 0))
    return one
