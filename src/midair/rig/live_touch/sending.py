"""The sensor side of the network: calibrated, encrypted frames, sent one by one to the playing side."""

import secrets
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from midair.calibration import CausalInverse
from midair.devices import StreamedSensor
from midair.errors import DeviceError, InputError
from midair.model import BAND, Calibration
from midair.rig.live_touch.encryption import (
    END,
    FRAME,
    HELLO,
    NUMBER,
    WELCOME,
    FrameCipher,
    SessionOffer,
    frame_message,
)
from midair.rig.live_touch.timing import RateMeter, SensorRate, measured_rate


@dataclass(slots=True)
class SendStatistics:
    """Counts of sent frames."""

    frames: int = 0
    """Frames of the sensor, lost ones included."""
    lost: int = 0
    """Frames that the sensor lost; they are not sent, and the other side repeats the last one."""
    unsent: int = 0
    """Frames that this computer's network refused."""


class FrameSender:
    """Sends a sensor's pressure to address and port `to` of the playing side; `patience` is the longest wait in s."""

    def __init__(
        self,
        sensor: StreamedSensor,
        calibration: Calibration,
        to: tuple[str, int],
        key: bytes,
        *,
        band: tuple[float, float] = BAND,
        delay: float = 0.006,
        patience: float = 30.0,
    ) -> None:
        self._sensor, self._seal, self._patience = sensor, FrameCipher(key), patience
        self._inverse = CausalInverse(calibration, sensor.rate, band=band, delay=delay)
        grid = sensor.grid
        self.greeting = SessionOffer(
            rows=grid.rows,
            columns=grid.columns,
            pitch=grid.pitch,
            name=grid.name,
            rate=sensor.rate,
            delay=delay,
            simulated=sensor.simulated,
        )
        try:
            family, _, _, _, address = socket.getaddrinfo(*to, type=socket.SOCK_DGRAM)[0]
        except OSError as wrong:
            raise InputError(f"--to {to[0]}:{to[1]}: expected a known host, got: {wrong.strerror}") from wrong
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._drawn = b""
        self.spoken = SendStatistics()
        self._meter = RateMeter()

    @property
    def rate(self) -> SensorRate:
        """Frame rate of the sensor, by this computer's clock."""
        return SensorRate(stated_rate=self._sensor.rate, rate=measured_rate(self._meter.frames, self._meter.span))

    def greet(self) -> None:
        """Send greetings until the other side answers; DeviceError if no side with the key answers."""
        begun, until = secrets.token_bytes(NUMBER), time.monotonic() + self._patience
        hello = begun + self.greeting.message()
        while time.monotonic() < until:
            self._send(HELLO, hello)
            if self._answered(begun, 0.2):
                return
        raise DeviceError(
            f"live: expected an answer, got none in {self._patience:g} s; check that midair live --listen runs there "
            "with the same key, and that firewalls allow UDP"
        )

    def run(self, going: Callable[[], bool]) -> None:
        """Send frames while `going` returns True; DeviceError if the sensor is lost."""
        pressure, expected = np.zeros(self._sensor.grid.count), 0
        self._sensor.start()
        try:
            while going():
                if not self._sensor.ready(0.05):
                    continue
                block = self._sensor.read(1)
                frame = block.samples.reshape(-1)
                for _ in range(block.first - expected + 1):
                    self._inverse.step(frame, pressure)
                self.spoken.lost += block.first - expected
                expected = block.first + 1
                self.spoken.frames = expected
                self._meter.add(block.first, block.host_time)
                if not self._send(FRAME, frame_message(block.first, block.host_time, pressure, self._drawn)):
                    self.spoken.unsent += 1
        finally:
            self._sensor.stop()
            for _ in range(3):
                self._send(END, self._drawn)

    def close(self) -> None:
        """Close the port."""
        self._socket.close()

    def _send(self, kind: bytes, message: bytes) -> bool:
        try:
            self._socket.send(self._seal.close(kind, message))
        except OSError:  # the other side is not listening
            return False
        return True

    def _answered(self, begun: bytes, wait: float) -> bool:
        self._socket.settimeout(wait)
        try:
            opened = self._seal.open(self._socket.recv(2048))
        except OSError:
            # A closed port answers at once, but may open soon.
            time.sleep(0.05)
            return False
        if opened is None or opened[0] != WELCOME or opened[1][:NUMBER] != begun:
            return False
        self._drawn = opened[1][NUMBER:]
        return len(self._drawn) == NUMBER
