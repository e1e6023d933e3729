"""A sensor on a serial port that sends the frames of `serial_frames`; needs the extra `serial`."""

import errno
import os
import sys
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import serial
from serial.tools.list_ports import comports

from midair.devices.safety.stop_guard import device_lock
from midair.devices.sensors.serial_frames import Decoder, Frames, Layout
from midair.devices.sensors.sources import Chunk, SensorOptions, Source, Stream, above_zero, opened
from midair.errors import DeviceError


class SerialSource(Source):
    """Frames received at a serial port, such as ``/dev/ttyUSB0`` or ``COM3``.

    USB devices without a real serial line ignore `baud`; 16 channels of 16 bits at 1 kHz need 540 000 bits per second
    with start and stop bits. `search` limits the time to the first whole frame, in s. `connect` opens the port, for
    tests.
    """

    def __init__(
        self, port: str, *, baud: int = 921_600, search: float = 2.0, connect: Callable[[], Any] | None = None
    ) -> None:
        self._name, self._search = port, search
        self._connect = connect or (lambda: exclusive_port(port, baud))
        self._hold = ExitStack()
        self._port: Any = None
        self._decoder = Decoder()
        self._waiting: deque[Frames] = deque()
        self._base: int | None = None
        self._arrived = 0.0

    def open(self) -> Stream:
        """Open the port and wait for one whole frame, which defines channels and rate."""
        with ExitStack() as hold:
            # The real path, since one port has several names.
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
        """Discard the received bytes; the next whole frame is frame 0."""
        self._convert_errors(opened(self._port, "serial").reset_input_buffer)
        # The layout stays, since `open` returned its channels and rate.
        self._decoder = Decoder(layout=self._decoder.layout)
        self._waiting.clear()
        self._base = None

    def pull(self, wait: float) -> Chunk | None:
        """Return the whole frames that were received."""
        end = time.monotonic() + wait
        while not self._waiting and time.monotonic() < end:
            self._waiting.extend(self._decoder.push(self._read()))
        return self._chunk(self._waiting.popleft()) if self._waiting else None

    def close(self) -> None:
        """Close the port."""
        port, self._port = self._port, None
        with self._hold:
            if port is not None:
                # Let other programs open the port again, which a system may not do while another process has it open.
                if sys.platform != "win32":
                    import fcntl
                    import termios

                    with suppress(OSError, AttributeError, ValueError):
                        fcntl.ioctl(port.fileno(), termios.TIOCNXCL)
                port.close()

    def describe(self) -> dict[str, str]:
        """Port, and transmission errors since start."""
        return {
            "port": self._name,
            "damaged frames": str(self._decoder.broken),
            "bytes outside frames": str(self._decoder.skipped),
        }

    def _listen(self) -> Layout:
        decoder, received, end = Decoder(), 0, time.monotonic() + self._search
        while time.monotonic() < end:
            data = self._read()
            received += len(data)
            if decoder.push(data) and decoder.layout is not None:
                self._decoder = decoder
                return decoder.layout
        raise DeviceError(
            f"serial: expected frames at {self._name}, got {received} bytes in {self._search:g} s and no whole frame; "
            "check the port, ?baud= and the protocol (docs, build a sensor)"
        )

    def _read(self) -> bytes:
        port = opened(self._port, "serial")
        # At least one byte, so that an empty port blocks instead of being polled.
        data: bytes = self._convert_errors(lambda: port.read(max(1, port.in_waiting)))
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
            # Frames received together were sampled one after another, the last one just now.
            host_time=self._arrived - span,
        )

    def _convert_errors(self, call: Callable[[], Any]) -> Any:
        """Convert pyserial's errors: OSError, and TypeError if the port was closed meanwhile."""
        try:
            return call()
        except (OSError, TypeError) as wrong:
            raise DeviceError(f"serial: lost {self._name}: {wrong}; plug it in and start again") from wrong


def exclusive_port(port: str, baud: int) -> Any:
    """Open a port exclusively, as far as the system supports it."""
    opened = serial.Serial(port, baud, timeout=0.05, exclusive=True if os.name == "posix" else None)
    if sys.platform != "win32":
        import fcntl
        import termios

        # pyserial's lock only affects programs that check it; this makes the system refuse all others.
        with suppress(OSError):
            fcntl.ioctl(opened.fileno(), termios.TIOCEXCL)
    return opened


def ports() -> list[str]:
    """Serial ports of this computer."""
    return sorted(port.device for port in comports())


def _advice(port: str, wrong: Exception) -> str:
    """Advice for a port that cannot be opened."""
    if getattr(wrong, "errno", None) in (errno.EACCES, errno.EPERM):
        return f"you may not open it: sudo usermod -aG {_group(port)} $USER, then log out and in again"
    if getattr(wrong, "errno", None) in (errno.EBUSY, errno.EAGAIN):
        return f"another program has it open: lsof {port} names it"
    return f"ports here: {', '.join(ports()) or 'none'}"


def _group(port: str) -> str:
    """Group that may open the port; dialout if unknown."""
    try:
        return Path(port).group()
    except (OSError, KeyError, NotImplementedError):
        return "dialout"


@dataclass(frozen=True, kw_only=True)
class SerialSensor(SensorOptions):
    """Kind ``serial:PORT``."""

    package = "pyserial"
    baud: int = above_zero(921_600, "Bits per second.")

    def source(self, place: str) -> SerialSource:
        """Sensor at a port."""
        return SerialSource(place, baud=self.baud)

    @classmethod
    def available(cls) -> str:
        """Ports of this computer."""
        return f"ports: {', '.join(ports()) or 'none'}"
