"""The AdapTics Designer plays on the array: its WebSocket messages, answered as by its own engine (docs/draw.md).

The pattern is evaluated while it plays. Each block of frames is drawn and checked before it sounds, in a thread of its
own, one block ahead; a block that is not ready in time is silent.
"""

import asyncio
import json
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field
from websockets.asyncio.server import Request, Response, ServerConnection

from midair.array_types import Array
from midair.devices import Tracker, check_exposure_steered, intensity_bytes, phase_bytes
from midair.errors import InputError, MidairError
from midair.model import Drive, PalmPath
from midair.patterns import AdapticsPattern, Evaluated, Foci, draw_parts, read_adaptics
from midair.physics import PoseBox
from midair.rig.names.sensor_names import open_tracker
from midair.rig.playing.following import tracker_name
from midair.rig.playing.play_settings import PlaySettings
from midair.rig.remote.messages import checked, models, object_of
from midair.rig.remote.player import FramePlayer, leave_realtime
from midair.rig.remote.server import Client, Server, play_and_serve
from midair.validation import positive

RATE, BLOCK = 1000.0, 16
"""Frames per second, and frames that are drawn at once."""
PLACES, MIDDLE = (
    np.array([[-0.08, -0.08, 0.12], [0.08, 0.08, 0.3]]),
    np.array([[-0.04, -0.04, 0.19], [0.04, 0.04, 0.21]]),
)
"""Lowest and highest place that may sound, and those of the first check, in m."""
PATIENCE = 0.1
"""Time in s after the last pose of a palm that is followed until the pattern is silent."""
NAME = "AdapTics Designer"
_PAGES = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?|https://adaptivehaptics\.github\.io")
"""Pages whose scripts may connect: those of this computer, and the public Designer."""
_ROW = Annotated[list[float], Field(min_length=4, max_length=4)]
_PARAMETERS = {
    "time": (float, 0.0),
    "user_parameters": (dict[str, float], {}),
    "geometric_transform": (list[_ROW], Field(min_length=4, max_length=4)),
}
Parameters = models("ignore", {"parameters": _PARAMETERS})["parameters"]
UPDATES = models(
    "ignore",
    {
        "update_pattern": {"pattern_json": (str, ...)},
        "update_playstart": {"playstart": (float, ...), "playstart_offset": (float, ...)},
        "update_parameters": {"evaluator_params": (Parameters, ...)},
        "update_tracking": {"enabled": (bool, ...)},
    },
)
"""Messages of the Designer; all times in ms."""


class Stream:
    """Frames of the Designer's pattern for a player; `pressure` is that of intensity 1, in Pa.

    Raises ExposureError if foci of that pressure exceed the exposure profile.
    """

    def __init__(
        self, player: FramePlayer, pressure: float, tracker: Tracker | None, report: Callable[[str], object]
    ) -> None:
        self._array, self._acoustics = player.aim()
        self._units, self._pressure, self._report = player.array.placement.units, pressure, report
        self.tracker, self.follows = tracker, False
        self.pattern: AdapticsPattern | None = None
        """The pattern that the next block takes."""
        self.transform = np.eye(4)
        self.evals = deque[dict[str, Any]](maxlen=10 * BLOCK)
        """Evaluated points that the Designer has not got yet."""
        self._plays: AdapticsPattern | None = None
        self._time, self._state, self._stopped = 0.0, (0.0, 0.0), True
        self._lock, self._pool = threading.Lock(), ThreadPoolExecutor(1, initializer=leave_realtime)
        self._next: Future[Drive | None] = Future()
        rng, self._most = np.random.default_rng(0), 1.0
        self._random = rng.random
        samples = self._drawn(
            rng.uniform(MIDDLE[0], MIDDLE[1], (128, 3)), np.full(128, positive(pressure, "pressure", "Pa"))
        )
        self._most = float(samples.level.max())
        # Nothing is known of the frames to come: heat is that of a still focus on the palm at the highest level.
        still = replace(self._drawn(MIDDLE.mean(axis=0)[None], np.full(1, pressure)), level=np.full(1, self._most))
        # Frames may jump, and are measured by some of them.
        how: dict[str, Any] = {"box": PoseBox(), "solved": np.zeros(3), "jumps": True, "endless": True}
        choices = player.settings.exposure
        self._clearance = check_exposure_steered(still, player.array, choices, samples=samples, **how)
        made: dict[str, Any] = {"about": {"file": NAME}, "frames": self.frames, "block": BLOCK}
        player.add(self._clearance, NAME, **made, rate=RATE, length=1000 * BLOCK)

    def begin(self, at: float, state: float) -> None:
        """Begin at a time in ms of the pattern; jumps after the time `state` are taken."""
        with self._lock:
            self._next = self._pool.submit(self._block, (at, state))

    def frames(self, part: slice, _: Array) -> tuple[Any, Any]:
        """Phases and intensities of the next block; silent ones if it is not ready."""
        drive, count = None, part.stop - part.start
        with self._lock:
            if self._next.done():
                drive, self._next = self._next.result(), self._pool.submit(self._block)
        if drive is None:
            return np.zeros((count, self._units, self._array.count // self._units), np.uint8), np.zeros(count, np.uint8)
        return phase_bytes(drive, self._units)[:count], intensity_bytes(drive, 1)[:count]

    def _block(self, begin: tuple[float, float] | None = None) -> Drive | None:
        """The frames of the next block, checked; None if they are silent."""
        if begin is not None:
            self._time, self._state, self._stopped = begin[0], (begin[1], 0.0), False
        plays, self._plays = self._plays if begin is None else None, self.pattern
        if self._plays is None or self._stopped:
            return None
        try:
            points, ended = self._points(self._plays)
            # A changed pattern is mixed in within the block.
            before = points if plays is None or plays is self._plays else self._points(plays)[0]
            old, new = (np.array([[*each.place, each.intensity] for each in some]) for some in (before, points))
            drive = self._drawn(*self._pressed(old + (np.arange(BLOCK) + 1.0)[:, None] / BLOCK * (new - old)))
            self._time, self._state, self._stopped = self._time + 1e3 * BLOCK / RATE, points[-1].state, ended
            self.evals.extend(_told(point) for point in points)
            return self._clearance.steered(drive, None)
        except (MidairError, ArithmeticError, ValueError) as wrong:
            self._stopped = True
            self._report(f"{NAME}: {wrong}")
            return None

    def _points(self, pattern: AdapticsPattern) -> tuple[list[Evaluated], bool]:
        """The points of the next block, and whether the pattern ends there."""
        state, points, stopped = self._state, list[Evaluated](), False
        for number in range(BLOCK):
            point = pattern.evaluate(self._time + 1e3 * number / RATE, state, draw=self._random)
            state, stopped = point.state, stopped or point.stop
            points.append(point._replace(intensity=0.0) if stopped else point)
        return points, stopped

    def _pressed(self, points: Array) -> tuple[Array, Array]:
        """Places in m and pressures in Pa of points (point, 4) in mm; 0 Pa outside `PLACES`."""
        with np.errstate(all="ignore"):
            moved = np.column_stack([points[:, :3], np.ones(len(points))]) @ self.transform.T
            place = 1e-3 * moved[:, :3] / moved[:, 3:]
        pressure = self._pressure * np.clip(points[:, 3], 0, 1)
        if self.follows:
            palm = self.palm()
            pressure = 0 * pressure if palm is None else pressure
            place = place if palm is None else place * [1, 1, 0] + palm.centre[-1]
        inside = ((place >= PLACES[0]) & (place <= PLACES[1])).all(axis=1)
        return np.where(inside[:, None], place, PLACES.mean(axis=0)), np.where(inside, pressure, 0.0)

    def palm(self) -> PalmPath | None:
        """The newest pose of the palm; None without one of the last `PATIENCE` s."""
        palm = None if self.tracker is None else self.tracker.newest()
        return None if palm is None or time.monotonic() - palm.time[-1] > PATIENCE else palm

    def _drawn(self, place: Array, pressure: Array) -> Drive:
        foci = Foci(position=place[:, None], pressure=pressure[:, None], rate=RATE)
        drive = next(draw_parts(foci, self._array, acoustics=self._acoustics)).drive
        return replace(drive, level=np.minimum(drive.level, self._most))


def _told(point: Evaluated) -> dict[str, Any]:
    """A point as the engine of AdapTics reports it."""
    coords, (last, offset) = dict(zip("xyz", point.place, strict=True)), point.state
    told = {"ul_control_point": {"coords": coords, "intensity": point.intensity}, "pattern_time": point.time}
    return told | {"stop": point.stop, "next_eval_params": {"last_eval_pattern_time": last, "time_offset": offset}}


def _hand(palm: PalmPath | None) -> dict[str, Any]:
    """A palm as the engine of AdapTics reports a hand; its fingers, which are not tracked, have no size."""
    if palm is None:
        return {"hand": None}
    place, normal, direction = (
        dict(zip("xyz", each[-1].tolist(), strict=True)) for each in (1e3 * palm.centre, palm.normal, palm.fingers)
    )
    bones = 4 * [{"start": place, "end": place, "width": 0.0}]
    shown = {"position": place, "width": 85.0, "normal": normal, "direction": direction}
    return {"hand": {"chirality": "Right", "palm": shown, "digits": 5 * [{"bones": bones}]}}


class DesignerServer(Server):
    """Answers the Designer, without a key but only to pages of this computer and the public one."""

    free, most_bytes, strict = ("stop",), 1_000_000, True

    def __init__(self, player: FramePlayer, stream: Stream, report: Callable[[str], object]) -> None:
        super().__init__(player, Path(), "", report)
        self._stream, self._start = stream, 0.0
        self._wanted = self._taken = ("", dict[str, float]())

    def check(self, connection: ServerConnection, request: Request) -> Response | None:
        """Refuse the scripts of other pages."""
        origin = request.headers.get("Origin")
        if origin is None or _PAGES.fullmatch(origin):
            return None
        self._refuse(f"a page of {origin[:60]!r}")
        return connection.respond(403, "midair serve adaptics: expected a page of this computer\n")

    @staticmethod
    def read(text: str | bytes) -> tuple[str, BaseModel]:
        """Name and fields of a message; the name "stop" if it stops."""
        found = object_of(text)
        name, update = checked(found.get("cmd"), found.get("data"), UPDATES, strict=True)
        return "stop" if name == "update_playstart" and not getattr(update, "playstart", 0) else name, update

    def text(self, name: str, found: dict[str, Any]) -> str:
        """A message to the Designer, which ignores answers."""
        return json.dumps({"cmd": name if name in ("playback_update", "tracking_data") else "ignoreme", "data": found})

    def send_states(self, state: dict[str, Any]) -> None:
        """Send the evaluated points, and the palm if it is tracked, in place of a state."""
        del state
        if self._stream.tracker is not None:
            for client in self._clients.values():
                client.send("tracking_data", {"tracking_frame": _hand(self._stream.palm())})
        evals = [self._stream.evals.popleft() for _ in range(len(self._stream.evals))]
        for client in self._clients.values() if evals else ():
            client.send("playback_update", {"evals": evals})

    async def act(self, client: Client, name: str, message: Any) -> dict[str, Any]:
        """Do what a message asks."""
        player, stream = self._player, self._stream
        if name == "stop":
            player.lease.stop()
            return {}
        async with self._loading:
            match name:
                case "update_pattern":
                    self._wanted = message.pattern_json, self._wanted[1]
                case "update_parameters":
                    asked = message.evaluator_params
                    self._wanted, self._start = (self._wanted[0], asked.user_parameters), asked.time
                    stream.transform = np.array(asked.geometric_transform)
                case "update_tracking":
                    if message.enabled and stream.tracker is None:
                        raise InputError("tracking: expected a tracker, got none; start the server with --follow")
                    stream.follows = message.enabled
                case _:
                    stream.begin(-message.playstart_offset, self._start)
                    loaded = player.trigger(NAME, 0)
                    await asyncio.to_thread(loaded.log, "trigger", f"client {client.number}")
            if self._wanted != self._taken and self._wanted[0]:
                stream.pattern = await asyncio.to_thread(read_adaptics, *self._wanted)
                self._taken = self._wanted
        return {}


def serve_adaptics(
    *,
    settings: PlaySettings | None = None,
    pressure: float = 50.0,
    port: int = 8037,
    report: Callable[[str], object] = print,
    ready: Callable[[int], object] = lambda _port: None,
) -> None:
    """Let the AdapTics Designer on this computer play its pattern, as `serve` does; intensity 1 is `pressure` in Pa.

    The settings may name a tracker, which the Designer can ask to follow. Raises the errors of `serve`, and
    ExposureError if foci of that pressure exceed the exposure profile.
    """
    chosen = settings or PlaySettings()
    follow = tracker_name(chosen.follow, chosen.tracker_latency)
    with open_tracker(follow) if follow else nullcontext() as tracker:

        def server(player: FramePlayer) -> DesignerServer:
            return DesignerServer(player, Stream(player, pressure, tracker, report), report)

        play_and_serve(chosen, server, "127.0.0.1", (port,), ready)
