"""A sensor on a serial line, USB or not, that sends the frames of `serial_frames`. Imports the extra `serial`."""

import errno
import os
import sys
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Protocol

import serial
from pydantic import PositiveInt
from serial.tools.list_ports import comports

from midair.devices.safety import device_lock
from midair.devices.sensors.serial_frames import Decoder, Frames, Layout
from midair.devices.sensors.sources import Chunk, SensorOptions, Stream
from midair.errors import DeviceError, DeviceStateError


class Port(Protocol):
    """What is used of `serial.Serial`."""

    @property
    def in_waiting(self) -> int:
        """Bytes that have come."""
        ...

    def read(self, size: int = 1) -> bytes:
        """Read up to `size` bytes: at least one within the time limit, or none."""
        ...

    def reset_input_buffer(self) -> None:
        """Throw away what has come."""
        ...

    def close(self) -> None:
        """Let go of the port."""
        ...


class SerialSource:
    """The frames that come in at a port.

    Parameters
    ----------
    port : str
        Such as ``/dev/ttyUSB0`` or ``COM3``.
    baud : int
        Bits per second; a USB device that is no real serial line ignores it. 16 channels of 16 bits at 1 kHz are
        540 000 bits per second with start and stop bits.
    search : float
        How long to wait for the first whole frame, in s.
    connect : callable, optional
        Opens the port; for tests.
    """

    def __init__(
        self, port: str, *, baud: int = 921_600, search: float = 2.0, connect: Callable[[], Port] | None = None
    ) -> None:
        self._name, self._search = port, search
        self._connect = connect or (lambda: exclusive_port(port, baud))
        self._hold = ExitStack()
        self._port: Port | None = None
        self._decoder = Decoder()
        self._waiting: deque[Frames] = deque()
        self._base: int | None = None
        self._arrived = 0.0

    def open(self) -> Stream:
        """Open the port and listen until one whole frame has come, which says what the sensor sends."""
        with ExitStack() as hold:
            # By its real path, since one port has several names.
            hold.enter_context(device_lock(f"serial:{os.path.realpath(self._name)}"))
            try:
                self._port = self._connect()
            except (OSError, ValueError) as wrong:
                refused = f"serial: expected a port {self._name}, got: {wrong}"
                raise DeviceError(f"{refused}; {_advice(self._name, wrong)}") from wrong
            self._hold = hold.pop_all()
        try:
            layout = self._listen()
        except BaseException:
            self.close()
            raise
        return Stream(channels=layout.channels, rate=1e9 / layout.period, full_scale=float(layout.full_scale))

    def start(self) -> None:
        """Throw away what has come; the next whole frame is frame 0."""
        self._guarded(self._opened().reset_input_buffer)
        # The layout stays, since channels and rate were told when it was opened.
        self._decoder = Decoder(layout=self._decoder.layout)
        self._waiting.clear()
        self._base = None

    def pull(self, wait: float) -> Chunk | None:
        """The whole frames that came."""
        end = time.monotonic() + wait
        while not self._waiting and time.monotonic() < end:
            self._waiting.extend(self._decoder.push(self._read()))
        return self._chunk(self._waiting.popleft()) if self._waiting else None

    def stop(self) -> None:
        """Nothing to tell: the sensor always sends."""

    def close(self) -> None:
        """Let go of the port."""
        port, self._port = self._port, None
        with self._hold:
            if port is not None:
                _share(port)
                port.close()

    def describe(self) -> dict[str, str]:
        """What was wrong on the line since start."""
        return {
            "port": self._name,
            "damaged frames": str(self._decoder.broken),
            "bytes outside frames": str(self._decoder.skipped),
        }

    def _listen(self) -> Layout:
        decoder, heard, end = Decoder(), 0, time.monotonic() + self._search
        while time.monotonic() < end:
            data = self._read()
            heard += len(data)
            if decoder.push(data) and decoder.layout is not None:
                self._decoder = decoder
                return decoder.layout
        raise DeviceError(
            f"serial: expected frames at {self._name}, got {heard} bytes in {self._search:g} s and no whole frame; "
            "check the port, ?baud= and the protocol (docs, build a sensor)"
        )

    def _read(self) -> bytes:
        port = self._opened()
        # At least one byte, so that an empty port is waited for and not asked again and again.
        data: bytes = self._guarded(lambda: port.read(max(1, port.in_waiting)))
        self._arrived = time.monotonic()
        return data

    def _chunk(self, frames: Frames) -> Chunk:
        if self._base is None:
            self._base = frames.counter
        layout = self._decoder.layout
        span = 0.0 if layout is None else len(frames.samples) * layout.period * 1e-9
        return Chunk(
            samples=frames.samples,
            first=frames.counter - self._base,
            device_time=frames.time_us * 1e-6,
            # What came at once was taken one frame after another, the last one just now.
            host_time=self._arrived - span,
        )

    def _guarded(self, call: Callable[[], Any]) -> Any:
        """What the port answers; pyserial's errors are OSErrors, and TypeError when it was closed meanwhile."""
        try:
            return call()
        except (OSError, TypeError) as wrong:
            raise DeviceError(f"serial: lost {self._name}: {wrong}; plug it in and start again") from wrong

    def _opened(self) -> Port:
        if self._port is None:
            raise DeviceStateError("serial: expected open first")
        return self._port


def exclusive_port(port: str, baud: int) -> Any:
    """An open port that nobody else opens meanwhile, as far as the system can see to that."""
    opened = serial.Serial(port, baud, timeout=0.05, exclusive=True if os.name == "posix" else None)
    if sys.platform != "win32":
        import fcntl
        import termios

        # pyserial's own lock is a word among programs that ask for one; this makes the system refuse the others too.
        with suppress(OSError):
            fcntl.ioctl(opened.fileno(), termios.TIOCEXCL)
    return opened


def _share(port: Any) -> None:
    """Let others open a port again, which a system may not do by itself while somebody else has it open."""
    if sys.platform != "win32":
        import fcntl
        import termios

        with suppress(OSError, AttributeError, ValueError):
            fcntl.ioctl(port.fileno(), termios.TIOCNXCL)


def ports() -> list[str]:
    """Serial ports of this computer."""
    return sorted(port.device for port in comports())


def _advice(port: str, wrong: Exception) -> str:
    """What to do about a port that cannot be opened."""
    if getattr(wrong, "errno", None) in (errno.EACCES, errno.EPERM):
        return f"you may not open it: sudo usermod -aG {_group(port)} $USER, then log out and in again"
    if getattr(wrong, "errno", None) in (errno.EBUSY, errno.EAGAIN):
        return f"another program has it open: lsof {port} names it"
    return f"ports here: {', '.join(ports()) or 'none'}"


def _group(port: str) -> str:
    """The group that may open a port; dialout, as most systems call it, where the port does not tell."""
    try:
        return Path(port).group()
    except (OSError, KeyError, NotImplementedError):
        return "dialout"


class SerialSensor(SensorOptions):
    """Kind ``serial:PORT``; further option: bits per second."""

    package = "pyserial"
    baud: PositiveInt = 921_600

    def source(self, place: str) -> SerialSource:
        """Sensor at a port."""
        return SerialSource(place, baud=self.baud)

    @classmethod
    def available(cls) -> str:
        """Ports of this computer."""
        return f"ports: {', '.join(ports()) or 'none'}"
