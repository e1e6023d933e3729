"""`midair.live` and `midair.send_touch`: play a sensor's signal on an array, on one computer or over a network."""

import secrets
import socket
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from midair.calibration import CausalInverse
from midair.devices import Cooling, ExposureClearance, StreamedSensor, check_exposure_level
from midair.errors import DeviceError, InputError
from midair.model import BAND, RATE, Calibration
from midair.rig.live_touch.encryption import (
    END,
    FRAME,
    HELLO,
    NUMBER,
    WELCOME,
    FrameCipher,
    SessionOffer,
    frame_message,
    read_key,
)
from midair.rig.live_touch.live_settings import LiveSettings, host_and_port
from midair.rig.live_touch.process import array_for, calibration_for, check_rate, sensor_for
from midair.rig.live_touch.session import LiveSession
from midair.rig.live_touch.timing import RateMeter, SensorRate, measured_rate
from midair.rig.play_lease import LeaseToken, PlayLease


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


def live(
    sensor: str | None = None,
    device: str | None = None,
    *,
    settings: LiveSettings | None = None,
    cooling: Cooling | None = None,
    keep: str | Path | None = None,
    notes: dict[str, str] | None = None,
    permit: PlayLease | None = None,
    leave: LeaseToken | None = None,
    report: Callable[[str], object] | None = None,
    **changes: Any,
) -> LiveSession:
    """Play a sensor's signal on an array, 13 ms later by default; a context manager that is silent after leaving.

    It runs in a separate process. A script has to start it below ``if __name__ == "__main__":``, since that process
    imports the script as well. Raises InputError if a value is out of range, or a sensor is too slow for live touch.

    Parameters
    ----------
    sensor, device : str, optional
        Names of the sensor and of the array, as in `LiveSettings`.
    settings : LiveSettings, optional
        All settings; the defaults if None.
    cooling : Cooling, optional
        How to wait in silence for units that are too hot; without it they end the session with TooHotError.
    keep : str or Path, optional
        File for a take of the sensor's samples and the emitted phases.
    notes : dict of str to str, optional
        Notes of the take.
    permit : PlayLease, optional
        Lease that another program renews and can stop; a lease of its own if None.
    leave : LeaseToken, optional
        Token of that lease's arming; armed here if None.
    report : callable, optional
        Called by ``wait`` with one line when following the palm begins or ends; with ``cooling`` also for its pauses.
    **changes
        Fields of `LiveSettings` that differ from `settings`, such as ``height=0.15``. Calibration, wiring and placement
        may be the path of a file.

    Returns
    -------
    LiveSession
        Enter it with ``with``: ``wait(seconds)``, ``statistics``, ``stop()``.

    Examples
    --------
    >>> with midair.live("virtual:towel", duration=2.0) as session:
    ...     session.wait()
    ...     print(session.statistics.late)
    """
    named: dict[str, Any] = {
        name: value for name, value in (("sensor", sensor), ("device", device)) if value is not None
    }
    if cooling is not None:
        named["cooling_limit"] = cooling.limit
    order = (settings or LiveSettings()).but(**named, **changes)
    return LiveSession(
        order,
        keep=None if keep is None else Path(keep),
        notes=notes,
        permit=permit,
        leave=leave,
        report=report or (None if cooling is None else cooling.report),
    )


def live_clearance(order: LiveSettings) -> ExposureClearance:
    """Check the exposure of live settings without opening a device; `live` checks again with the device.

    `rate` is the frame rate in Hz. Raises ExposureError if the worst case at this level exceeds the profile without an
    override.
    """
    array = array_for(order, RATE)
    return check_exposure_level(order.level, array, order.exposure, rate=order.schedule(RATE).formed * RATE)


@contextmanager
def send_touch(
    sensor: str, to: str, key: str | Path, *, settings: LiveSettings | None = None, **changes: Any
) -> Generator[FrameSender]:
    """Send a sensor's pressure to a `live` that listens elsewhere: connects on entering; ``run`` sends.

    `sensor` is a name as in `live`, `to` the host and port of the playing side, such as ``lab.example:5005``, `key` the
    key file that both sides share. Of `settings` and the fields that differ from them delay, band, calibration, wiring
    and seed apply. Raises DeviceError if there is no answer from a side with the key, InputError if an address, a key
    or a setting is invalid.
    """
    here = (settings or LiveSettings()).but(sensor=sensor, listen=None, **changes)
    opened, _ = sensor_for(here)
    with opened:
        check_rate(opened)
        calibration = calibration_for(here, opened) or Calibration.flat(opened.grid, unit="Pa")
        address, secret = host_and_port(to, "--to"), read_key(Path(key))
        speaker = FrameSender(opened, calibration, address, secret, band=here.band, delay=here.delay)
        try:
            speaker.greet()
            yield speaker
        finally:
            speaker.close()
