"""The side that feels: a sensor's frames, undone, sealed and sent one by one to the side that plays."""

import secrets
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from midair.calibration import CausalInverse
from midair.devices import StreamedSensor
from midair.errors import DeviceError, InputError
from midair.model import Calibration
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


@dataclass(slots=True)
class SendStatistics:
    """What was sent.

    Attributes
    ----------
    frames : int
        Of the sensor, those that it never gave included.
    lost : int
        That the sensor never gave; they are not sent, and the other side holds the last one.
    unsent : int
        That this computer's network did not take.
    """

    frames: int = 0
    lost: int = 0
    unsent: int = 0


class FrameSender:
    """Sends what a sensor feels to one who listens.

    Parameters
    ----------
    sensor : StreamedSensor
        Open.
    calibration : Calibration
        That undoes it.
    to : tuple of (str, int)
        Address and port of the side that plays.
    key : bytes
        That both sides share.
    band : tuple of float
        (low, high) of what is felt, in Hz.
    delay : float
        Of the causal inverse, in s.
    patience : float
        How long to wait for an answer, in s.
    """

    def __init__(
        self,
        sensor: StreamedSensor,
        calibration: Calibration,
        to: tuple[str, int],
        key: bytes,
        *,
        band: tuple[float, float] = (20.0, 470.0),
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
            raise InputError(f"--to {to[0]}:{to[1]}: expected a host that is known, {wrong.strerror}") from wrong
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._drawn = b""
        self.spoken = SendStatistics()

    def greet(self) -> None:
        """Say what is felt here, until the other side answers.

        Raises
        ------
        DeviceError
            If nobody answers who has the key.
        """
        begun, until = secrets.token_bytes(NUMBER), time.monotonic() + self._patience
        hello = begun + self.greeting.message()
        while time.monotonic() < until:
            self._send(HELLO, hello)
            if self._answered(begun, 0.2):
                return
        raise DeviceError(
            f"live: expected an answer, got none in {self._patience:g} s; is midair live --listen running there, with "
            "the same key, and does a firewall let UDP through?"
        )

    def run(self, going: Callable[[], bool]) -> None:
        """Send frames while `going` says so.

        Raises
        ------
        DeviceError
            If the sensor is lost.
        """
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
                if not self._send(FRAME, frame_message(block.first, block.host_time, pressure, self._drawn)):
                    self.spoken.unsent += 1
        finally:
            self._sensor.stop()
            for _ in range(3):
                self._send(END, self._drawn)

    def close(self) -> None:
        """Let go of the port."""
        self._socket.close()

    def _send(self, kind: bytes, message: bytes) -> bool:
        try:
            self._socket.send(self._seal.close(kind, message))
        except OSError:  # nobody is there yet, or any more
            return False
        return True

    def _answered(self, begun: bytes, wait: float) -> bool:
        self._socket.settimeout(wait)
        try:
            opened = self._seal.open(self._socket.recv(2048))
        except OSError:
            # A port where nobody listens yet answers at once; somebody may soon.
            time.sleep(0.05)
            return False
        if opened is None or opened[0] != WELCOME or opened[1][:NUMBER] != begun:
            return False
        self._drawn = opened[1][NUMBER:]
        return len(self._drawn) == NUMBER
