"""Poses in messages of Open Sound Control 1.0 over UDP."""

import socket
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from pythonosc import osc_message
from pythonosc.parsing import osc_types

from midair.devices.trackers.tracker import RawPose, TrackerOptions
from midair.errors import DeviceError, InputError


class OscPoses:
    """Messages with 9 or 10 numbers (those of `LslPoses`), at the time of their bundle or else of their arrival."""

    host_clock = False

    def __init__(self, place: str, address: str) -> None:
        host, _, port = place.rpartition(":")
        if not port.isdecimal() or not 0 <= int(port) < 65536:
            raise InputError(f"osc:{place}: expected a port from 1 to 65535, such as osc:9000, got {port!r}")
        self._host, self._port, self._address = host or "127.0.0.1", int(port), address
        self._socket: socket.socket | None = None
        self._offset = 0.0

    def open(self) -> None:
        """Listen to the port."""
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            link.bind((self._host, self._port))
        except OSError as wrong:
            link.close()
            raise DeviceError(
                f"osc: expected a free port {self._port} at {self._host}, got: {wrong.strerror}; choose another"
            ) from wrong
        self._socket = link
        self._offset = time.monotonic() - datetime.now(UTC).timestamp()

    def pull(self, wait: float) -> list[RawPose | str]:
        """Poses of the messages that have arrived."""
        if self._socket is None:
            raise DeviceError("osc: expected open first")
        found: list[RawPose | str] = []
        try:
            for _ in range(64):
                self._socket.settimeout(1e-6 if found else wait or 1e-6)
                packet = self._socket.recv(65536)
                try:
                    found += self._poses(packet, time.monotonic())
                except InputError as wrong:
                    found.append(f"a packet: {wrong}")
        except (TimeoutError, BlockingIOError):
            pass
        except OSError as wrong:
            raise DeviceError(f"osc: lost the port {self._port}: {wrong.strerror}") from wrong
        return found

    def close(self) -> None:
        """Free the port."""
        link, self._socket = self._socket, None
        if link is not None:
            link.close()

    def _poses(self, packet: bytes, arrived: float) -> list[RawPose | str]:
        found: list[RawPose | str] = []
        for stamp, address, values in osc_messages(packet):
            numbers = [float(each) for each in values if type(each) in (int, float)]
            if address == self._address and len(numbers) in (9, 10):
                at = arrived if stamp is None else stamp + self._offset
                found.append(RawPose(stamp=at, values=numbers[:9], confidence=(*numbers, 1.0)[9]))
            elif address == self._address:
                found.append(f"{len(numbers)} numbers instead of 9 or 10 at {address}")
        return found


LONGEST = 4096
"""Length of a message in bytes, above which it is refused: the time to read one grows with the square of its length."""
_READ = set(",ihfdsbrmtTFNScI")
_ALIKE = str.maketrans("ScI", "siN")
"""Type tags that python-osc leaves out with their values, and those of the same form that it reads."""


def osc_messages(packet: bytes) -> list[tuple[float | None, str, list[Any]]]:
    """Time since 1970 (None for now), address and values of each message of a packet; InputError if it is not OSC."""
    found: list[tuple[float | None, str, list[Any]]] = []
    left = [(0.0, packet)]
    try:
        while left:
            stamp, data = left.pop()
            if not data.startswith(b"#bundle\0"):
                found.append((stamp or None, *_message(data)))
                continue
            own, at = osc_types.get_date(data, 8)
            inner: list[tuple[float, bytes]] = []
            while at < len(data):
                size, at = osc_types.get_int(data, at)
                if not 0 < size <= len(data) - at:
                    raise ValueError(f"got an element of {size} bytes where {len(data) - at} are left")
                inner.append((max(stamp, own), data[at : at + size]))
                at += size
            left += reversed(inner)
    except (osc_types.ParseError, osc_message.ParseError, ValueError) as wrong:
        raise InputError(f"expected OSC 1.0: {' '.join(map(str, wrong.args))[:100]}") from None
    return found


def _message(data: bytes) -> tuple[str, list[Any]]:
    if len(data) > LONGEST:
        raise ValueError(f"expected a message of at most {LONGEST} bytes, got {len(data)} bytes")
    address, at = osc_types.get_string(data, 0)
    tags, at = osc_types.get_string(data, at) if data[at:] else (",", at)
    if not address.startswith("/"):
        raise ValueError(f"got an address {address[:40]!r} that does not begin with /")
    if not tags.startswith(",") or not _READ.issuperset(tags):
        raise ValueError(f"got type tags {tags[:40]!r} other than ,ihfdsbrmtTFNScI")
    # A number is added behind the last value, since python-osc reads a float that is cut off as 0.
    head = osc_types.write_string(address) + osc_types.write_string(tags.translate(_ALIKE) + "i")
    return address, osc_message.OscMessage(head + data[at:] + bytes(4)).params[:-1]


@dataclass(frozen=True, kw_only=True)
class OscTracker(TrackerOptions):
    """Kind ``osc:PORT``, on this computer alone, or ``osc:0.0.0.0:PORT``; `address` is that of the messages."""

    address: str = "/palm"

    def source(self, place: str) -> OscPoses:
        """Messages to a port."""
        return OscPoses(place, self.address)
