"""Kind ``udp:PORT``: a sensor that sends each frame as a datagram of the frame number and one float32 per channel."""

import socket
import struct
import time

import numpy as np
from pydantic import PositiveFloat, PositiveInt

from midair.devices import Chunk, SensorOptions, Stream
from midair.errors import DeviceError


class UdpSource:
    """Datagrams at a port of this computer: uint32 frame number, then float32 volts, little-endian."""

    def __init__(self, port: int, *, channels: int, rate: float) -> None:
        self._port, self._channels, self._rate = port, channels, rate
        self._socket: socket.socket | None = None
        self._first: int | None = None

    def open(self) -> Stream:
        """Open the port."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", self._port))
        except OSError as wrong:
            raise DeviceError(f"udp: expected a free port, got {self._port}: {wrong}") from wrong
        return Stream(channels=self._channels, rate=self._rate, unit="V", stored="f4")

    def start(self) -> None:
        """Count frames from the next datagram on."""
        self._first = None

    def pull(self, wait: float) -> Chunk | None:
        """Return the next frame, or None after `wait` seconds."""
        if self._socket is None:
            raise DeviceError("udp: expected an open port; open the sensor first")
        self._socket.settimeout(max(wait, 1e-3))
        try:
            data = self._socket.recv(65536)
        except TimeoutError:
            return None
        (number,) = struct.unpack_from("<I", data)
        samples = np.frombuffer(data, "<f4", offset=4)[None]
        if samples.shape[1] != self._channels:
            raise DeviceError(f"udp: expected {self._channels} channels, got a datagram of {samples.shape[1]}")
        self._first = number if self._first is None else self._first
        now = time.monotonic()
        return Chunk(samples=samples, first=number - self._first, device_time=number / self._rate, host_time=now)

    def stop(self) -> None:
        """Nothing to stop: the sender does not know about its receivers."""

    def close(self) -> None:
        """Close the port."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def describe(self) -> dict[str, str]:
        """One row for `midair doctor`."""
        return {"port": str(self._port)}


class UdpSensor(SensorOptions):
    """Options after the question mark, such as ``udp:5005?channels=16&hz=1000``."""

    channels: PositiveInt = 16
    hz: PositiveFloat = 1000.0

    def source(self, place: str) -> UdpSource:
        """Source at a port."""
        return UdpSource(int(place), channels=self.channels, rate=self.hz)

    @classmethod
    def available(cls) -> str:
        """UDP needs no library."""
        return "any free port"
