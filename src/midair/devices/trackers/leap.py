"""Ultraleap's tracking service by its WebSocket (protocol version 6); needs the extra `leap`."""

import json
from contextlib import ExitStack, suppress

from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import ClientConnection, connect

from midair.devices.trackers.leap_frames import LeapFrames, Side
from midair.devices.trackers.tracker import RawPose, TrackerOptions
from midair.errors import DeviceError

PORT = 6437


class LeapSource:
    """One hand of the service at a host and port."""

    host_clock = False

    def __init__(self, place: str, side: Side) -> None:
        host, _, port = place.partition(":")
        self._address = f"ws://{host or '127.0.0.1'}:{port or PORT}/v6.json"
        self._side: Side = side
        self._frames = LeapFrames(side)
        self._opened = ExitStack()
        self._socket: ClientConnection | None = None

    def open(self) -> None:
        """Connect, and request frames although this program has no window in the foreground."""
        self._frames = LeapFrames(self._side)
        try:
            link = connect(self._address, open_timeout=2.0, close_timeout=1.0, compression=None, proxy=None)
            self._socket = self._opened.enter_context(link)
            self._socket.send('{"background": true}')
            self._socket.send('{"focused": true}')
        except (OSError, WebSocketException, ValueError) as wrong:
            raise DeviceError(
                f"leap: expected Ultraleap's tracking service at {self._address}, got: {wrong}; start the service "
                "UltraleapTrackingWebSocket"
            ) from wrong

    def pull(self, wait: float) -> list[RawPose | str]:
        """Poses of the frames that have arrived."""
        found: list[RawPose | str] = []
        try:
            if self._socket is None:
                raise DeviceError("leap: expected open first")
            for _ in range(64):
                with suppress(ValueError, RecursionError):
                    pose = self._frames.read(json.loads(self._socket.recv(timeout=0.0 if found else wait)))
                    found += [] if pose is None else [pose]
                    continue
                found.append("a message that is no JSON")
        except TimeoutError:
            pass
        except (ConnectionClosed, OSError) as wrong:
            if not found:
                raise DeviceError(
                    f"leap: lost the tracking service at {self._address}; make sure that it runs"
                ) from wrong
        return found

    def close(self) -> None:
        """Disconnect."""
        self._socket = None
        self._opened.close()


class LeapTracker(TrackerOptions):
    """Kind ``leap:`` or ``leap:HOST:PORT``; `hand` is any, left or right."""

    hand: Side = "any"

    def source(self, place: str) -> LeapSource:
        """The service at a place, on this computer by default."""
        return LeapSource(place, self.hand)
