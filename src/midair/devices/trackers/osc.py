"""Poses in messages of Open Sound Control 1.0 over UDP.

It parses the packets itself: python-osc 1.10 never returns from an element of negative size, reads a number that is cut
off as 0, replaces the time of a bundle that has passed by now, and logs a line for each bad packet.
"""

import socket
import struct
import time
from collections.abc import Iterator
from datetime import UTC, datetime

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
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            made.bind((self._host, self._port))
        except OSError as wrong:
            made.close()
            raise DeviceError(
                f"osc: expected a free port {self._port} at {self._host}, got: {wrong.strerror}; choose another"
            ) from wrong
        self._socket = made
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
                except (ValueError, struct.error, IndexError):
                    found.append("a packet that is no OSC 1.0")
        except (TimeoutError, BlockingIOError):
            pass
        except OSError as wrong:
            raise DeviceError(f"osc: lost the port {self._port}: {wrong.strerror}") from wrong
        return found

    def close(self) -> None:
        """Free the port."""
        made, self._socket = self._socket, None
        if made is not None:
            made.close()

    def _poses(self, packet: bytes, arrived: float) -> list[RawPose | str]:
        found: list[RawPose | str] = []
        for stamp, address, values in osc_messages(packet):
            numbers = [each for each in values if isinstance(each, float)]
            if address == self._address and len(numbers) in (9, 10):
                at = arrived if stamp is None else stamp + self._offset
                found.append(RawPose(stamp=at, values=numbers[:9], confidence=(*numbers, 1.0)[9]))
            elif address == self._address:
                found.append(f"{len(numbers)} numbers instead of 9 or 10 at {address}")
        return found


EPOCH = 2208988800
"""Seconds from 1900 to 1970."""


def osc_messages(packet: bytes) -> Iterator[tuple[float | None, str, list[float | str]]]:
    """Time since 1970 (None for now), address and values of each message; ValueError, struct.error or IndexError."""
    if not packet.startswith(b"#bundle\0"):
        yield (None, *_message(packet))
        return
    seconds, fraction = struct.unpack_from(">II", packet, 8)
    stamp, at = (seconds - EPOCH + fraction / 2**32 if seconds else None), 16
    while at < len(packet):
        (size,) = struct.unpack_from(">I", packet, at)
        content, at = packet[at + 4 : at + 4 + size], at + 4 + size
        if not size or at > len(packet):
            raise ValueError("size of an element")
        if content.startswith(b"/"):
            yield (stamp, *_message(content))


def _message(data: bytes) -> tuple[str, list[float | str]]:
    address, at = _text(data, 0)
    tags, at = _text(data, at)
    if not address.startswith("/") or not tags.startswith(","):
        raise ValueError("address or type tags")
    values: list[float | str] = []
    for tag in tags[1:]:
        if tag in "ifd":
            values.append(float(struct.unpack_from(f">{tag}", data, at)[0]))
            at += 8 if tag == "d" else 4
        elif tag == "s":
            text, at = _text(data, at)
            values.append(text)
        elif tag not in "TFNI":
            raise ValueError("type tag")
    return address, values


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Text up to its NUL, and the place after its padding to 4 bytes."""
    end = data.index(b"\0", at)
    return data[at:end].decode("ascii"), end + 4 - (end - at) % 4


class OscTracker(TrackerOptions):
    """Kind ``osc:PORT``, on this computer alone, or ``osc:0.0.0.0:PORT``; `address` is that of the messages."""

    address: str = "/palm"

    def source(self, place: str) -> OscPoses:
        """Messages to a port."""
        return OscPoses(place, self.address)
