"""Ultraleap's tracking service by its WebSocket (protocol version 6); needs the extra `leap`."""

import json
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any, Literal

from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import ClientConnection, connect

from midair.devices.trackers.tracker import RawPose, TrackerOptions
from midair.errors import DeviceError

PORT = 6437

Side = Literal["any", "left", "right"]


class LeapFrames:
    """Follows one hand through frames of protocol version 6: the same one while it is seen, then that seen longest.

    Positions are in mm with y up and z towards the person; poses are in m with y away from the person and z up.
    """

    def __init__(self, side: Side = "any") -> None:
        self._side, self._id = side, None

    def read(self, frame: Any) -> RawPose | str | None:
        """The pose in a frame; None without a hand, and a text that describes a malformed frame."""
        if not isinstance(frame, Mapping):
            return "JSON that is no frame"
        if "hands" not in frame:
            return None
        try:
            hands: list[Mapping[str, Any]] = [hand for hand in frame["hands"] if self._side in ("any", hand["type"])]
            if not hands:
                self._id = None
                return None
            hand = next((hand for hand in hands if hand["id"] == self._id), None)
            hand = hand or max(hands, key=lambda one: float(one.get("timeVisible", 0.0)))
            self._id = hand["id"]
            return RawPose(
                stamp=float(frame["timestamp"]) * 1e-6,
                values=[
                    *(1e-3 * value for value in _turned(hand["palmPosition"])),
                    *_turned(hand["palmNormal"]),
                    *_turned(hand["direction"]),
                ],
                confidence=float(hand.get("confidence", 1.0)),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as wrong:
            return f"a frame without a usable {str(wrong)[:60]}"


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


@dataclass(frozen=True, kw_only=True)
class LeapTracker(TrackerOptions):
    """Kind ``leap:`` or ``leap:HOST:PORT``; `hand` is any, left or right."""

    hand: Side = "any"

    def source(self, place: str) -> LeapSource:
        """The service at a place, on this computer by default."""
        return LeapSource(place, self.hand)


def _turned(vector: Any) -> tuple[float, float, float]:
    x, y, z = vector
    return float(x), -float(z), float(y)
