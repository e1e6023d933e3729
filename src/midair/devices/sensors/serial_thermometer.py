"""A thermometer that sends lines of text at a serial port; needs the extra `serial`."""

import time
from typing import Any

from midair.devices.sensors.serial_port import exclusive_port
from midair.devices.sensors.thermometer import LINE, Thermometer
from midair.errors import DeviceError


class SerialThermometer(Thermometer):
    """Kind ``serial:PORT`` or ``serial:PORT?baud=9600``: each line is a temperature, such as ``22.4`` or ``22.4 C``.

    Other lines are ignored.
    """

    kind = "serial"

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._port: Any = None
        self._received, self._other = b"", ""
        self._value: float | None = None
        self._arrived = -float("inf")
        self._looked = -float("inf")

    def latest(self) -> tuple[float, float]:
        """The last line that was received, and its age."""
        try:
            port = self._port = self._port or self._opened()
            if time.monotonic() - self._looked > self.stale:
                # A full buffer keeps the oldest lines and loses the newest.
                port.reset_input_buffer()
                self._received, self._value = b"", None
            until = time.monotonic() + self.stale
            while port.in_waiting or (self._value is None and time.monotonic() < until):
                self._take(port.read(max(1, port.in_waiting)))
            self._looked = time.monotonic()
        except OSError as wrong:
            self.close()
            raise DeviceError(
                f"{self.name}: expected a thermometer at the port, got: {wrong}; check cable and port"
            ) from wrong
        if self._value is None:
            raise DeviceError(
                f"{self.name}: expected a line with degrees Celsius, such as 22.4, within {self.stale:g} s, got "
                f"{self._other!r}; check the thermometer and ?baud="
            )
        return self._value, time.monotonic() - self._arrived

    def close(self) -> None:
        """Close the port."""
        port, self._port = self._port, None
        self._value = None
        if port is not None:
            port.close()

    def _take(self, data: bytes) -> None:
        *lines, self._received = (self._received + data)[-1000:].replace(b"\r", b"\n").split(b"\n")
        for line in filter(None, lines):
            text = line.decode("utf-8", errors="replace")
            found = LINE.fullmatch(text)
            if found is None:
                self._other = text[:40]
            else:
                self._value, self._arrived = float(found[1]), time.monotonic()

    def _opened(self) -> Any:
        place, _, baud = self.place.partition("?baud=")
        if baud and not baud.isdecimal():
            raise DeviceError(f"{self.name}: expected a number of bits per second after ?baud=, got {baud!r}")
        return exclusive_port(place, int(baud or 9600))
