"""Remote control: clients play checked drives through JSON over WebSocket, or through OSC (docs/remote.md)."""

import asyncio
import json
import logging
import os
import queue
import struct
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from hmac import compare_digest
from math import ceil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from pydantic import ConfigDict, Field, ValidationError, create_model
from pydantic_core import from_json
from websockets.asyncio.server import Request, Response, ServerConnection, broadcast
from websockets.asyncio.server import serve as serve_websockets
from websockets.exceptions import ConnectionClosed

from midair.devices import (
    TICK,
    ImmediateArray,
    RawPose,
    Tracker,
    check_exposure,
    divider,
    intensity_bytes,
    osc_messages,
    phase_bytes,
)
from midair.errors import (
    DeviceError,
    DeviceStateError,
    FileError,
    InputError,
    MidairError,
    MissingFileError,
    SilentFramesError,
)
from midair.files import load_solution
from midair.model import RATE, Acoustics, Drive, Medium, Provenance
from midair.patterns import PATTERN_ENDINGS, draw, drawn_settings, load_pattern
from midair.rig.names import TRACKERS, array_calibration_for
from midair.rig.play_lease import LeaseToken, PlayLease
from midair.rig.playing import Follower, FollowRules, PlaySettings, clear_followed, grid_of, immediate_array, wait_until
from midair.rig.signals import signals_end_the_program

LEASE, LEAVES, REPEATED, FADE, WORD = 0.5, 5.0, 60.0, 0.005, 0.008
"""Times in s: without a sign of life until the client in control loses the array, and until any has left; for which the
check repeats a drive; of a change of the level from 0 to 1; between silent frames."""
STATES, MOST, LINES = 60, 1000, 20
"""States that each client gets a second; messages of one client a second; refusals that are printed."""
ENDINGS = (".drive.h5", *PATTERN_ENDINGS)

_FILE = (str, Field(min_length=1, max_length=200))
_FIELDS: dict[str, dict[str, Any]] = {
    **{name: {} for name in ("list", "control", "release", "stop")},
    "load": {"file": _FILE, "duration": (float | None, Field(None, gt=0, le=60)), "follow": (bool, False)},
    "play": {"file": _FILE, "repeats": (int, Field(1, ge=0, le=1_000_000))},
    "level": {"level": (float, Field(ge=0, le=1))},
    "palm": {"pose": (list[float], Field(min_length=9, max_length=9)), "confidence": (float, Field(1.0, ge=0, le=1))},
}
_RULES = ConfigDict(extra="forbid", allow_inf_nan=False)
MESSAGES = {name: create_model(name, __config__=_RULES, **fields) for name, fields in _FIELDS.items()}
"""Fields of all messages of clients, by name, for JSON and OSC."""


def read_json(text: str | bytes) -> tuple[str, Any]:
    """Name, under the key "do", and fields of a message in JSON; InputError if it is none."""
    try:
        found = from_json(text)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise InputError("expected an object in JSON, got other text")
    return _read(found.pop("do", None), found, strict=True)


def read_osc(packet: bytes) -> Iterator[tuple[str, str, Any]]:
    """Key, name and fields of each message /midair/NAME of an OSC packet; InputError if one is none."""
    try:
        found = [(address.removeprefix("/midair/"), values or [""]) for _, address, values in osc_messages(packet)]
    except (ValueError, struct.error, IndexError):
        raise InputError("expected OSC 1.0, got other bytes") from None
    for name, (key, *given) in found:
        rest = [given[:9], *given[9:]] if name == "palm" else given
        # A value too many gets the name of no field.
        names = [*_FIELDS.get(name, ()), *map(str, range(len(rest)))]
        yield str(key), *_read(name, dict(zip(names, rest, strict=False)), strict=False)


def osc_packet(address: str, *values: float | str) -> bytes:
    """An OSC message with numbers and texts."""
    tags = "," + "".join("s" if isinstance(each, str) else "f" for each in values)
    raw = [each.encode("ascii", "replace") if isinstance(each, str) else each for each in (address, tags, *values)]
    return b"".join(e + bytes(4 - len(e) % 4) if isinstance(e, bytes) else struct.pack(">f", e) for e in raw)


def _read(name: Any, fields: dict[str, Any], *, strict: bool) -> tuple[str, Any]:
    if not isinstance(name, str) or name not in MESSAGES:
        raise InputError(f"do: expected {', '.join(MESSAGES)}, got {repr(name)[:60]}")
    try:
        return name, MESSAGES[name].model_validate(fields, strict=strict)
    except ValidationError as wrong:
        first = wrong.errors(include_url=False, include_context=False)[0]
        where, got = ".".join(map(str, first["loc"])), repr(first["input"])
        raise InputError(f"{name}: {where[:60]}: {first['msg'][:100]}, got {got[:60]}") from None


class _Palm:
    """The palm as clients report it, as the source of a tracker."""

    host_clock = True

    def __init__(self) -> None:
        self._poses = queue.SimpleQueue[RawPose | str]()
        self.open = self.close = lambda: None
        self.add = self._poses.put

    def pull(self, wait: float) -> list[RawPose | str]:
        with suppress(queue.Empty):
            return [self._poses.get(timeout=wait or 1e-6)]
        return []


class _Player:
    """Plays loaded drives inside `drives_to_come` of an array, in a thread that runs `run` until a trigger is None."""

    def __init__(self, array: ImmediateArray, settings: PlaySettings, quiet: Any, begin: Any) -> None:
        self._array, self._settings, self._begin = array, settings, begin
        silence = np.zeros((array.placement.units, array.array.count // array.placement.units), np.uint8)
        self._quiet = partial(self._put, quiet, silence, 0)
        self.permit, self._token = PlayLease(), LeaseToken(number=0, stops=0)
        self.loaded: dict[str, SimpleNamespace] = {}
        self.level, self._late, self._failsafe = 1.0, 0, 0
        self.palm, self.silent = _Palm(), threading.Event()
        self.tracker = Tracker(self.palm, name="palm", options=TRACKERS["osc"]())
        self.triggers = queue.SimpleQueue[tuple[SimpleNamespace, int, LeaseToken] | None]()
        self._now: tuple[SimpleNamespace, int, float, int] | None = None

    def load(self, path: Path, duration: float | None, follow: bool) -> dict[str, Any]:
        """Read or draw a file, check its exposure and log the order; slow, for a thread of its own."""
        if hasattr(os, "sched_setscheduler"):
            with suppress(OSError):  # the check must not hold up the thread that plays
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        array, how, units = self._array, self._settings, self._array.placement.units
        drive = self._drawn(path, duration) if path.suffix in PATTERN_ENDINGS else load_solution(path).drive
        if not 100 <= drive.rate <= 8000 or drive.level.ndim > 1:
            expected = "100 to 8000 frames a second with one level for all transducers"
            raise InputError(f"{path.name}: expected {expected}, got {drive.rate:g} Hz, {drive.level.shape} levels")
        follower = None
        if follow:
            grid = grid_of(drive)
            admission = clear_followed(drive, array, replace(how, steer_only=True), grid)
            follower = Follower(self.tracker, drive, grid, rules=FollowRules(fit=False), report=lambda _: None)
        else:
            admission = check_exposure(drive, array, how.exposure, repeats=ceil(REPEATED * drive.rate / drive.frames))
            drive = admission.check_for(array)
        phases, intensities = np.asarray(phase_bytes(drive, units)), np.asarray(intensity_bytes(drive, 1))

        def frames(part: slice, times: Any) -> tuple[Any, Any]:
            # Phases and intensities of frames that sound at times of this computer's clock.
            if follower is None:
                return phases[part], intensities[part]
            steered = admission.steered(*follower.steered(part, times))
            return phase_bytes(steered, units), intensity_bytes(steered, 1)

        report: dict[str, Any] = {"plays": 0, "duration": 0.0}
        about: dict[str, Any] = {"file": path.name, "seconds": drive.frames / drive.rate, "rate_hz": drive.rate}
        about |= {"follow": follow, "exposure": admission.verdict()}
        put, log = self._begin(admission, path, report)
        made = {"put": put, "log": log, "report": report, "follower": follower, "frames": frames, "about": about}
        self.loaded[path.name] = SimpleNamespace(drive=drive, levels=admission.exposure.level, **made)
        return about

    def _drawn(self, path: Path, duration: float | None) -> Drive:
        pattern, acoustics = load_pattern(path), Acoustics(medium=self._settings.exposure.room or Medium.at())
        known, foci = array_calibration_for(self._settings.device), pattern.foci(duration)
        array = self._array.array if known is None else known.known.applied(self._array.array)
        life = drawn_settings(foci, acoustics).noted(Provenance(source=path.name))
        return replace(draw(foci, array, acoustics=acoustics).drive, provenance=life)

    def trigger(self, file: str, repeats: int) -> SimpleNamespace:
        """Play a loaded file now."""
        if file not in self.loaded:
            raise InputError(f"file: expected one that is loaded, {sorted(self.loaded)}, got {file[:60]!r}; load it")
        if self.permit.refusal(self._token) is not None:
            self._token = self.permit.arm(lasts=LEASE)
        self.silent.clear()
        self.triggers.put((self.loaded[file], repeats, self._token))
        return self.loaded[file]

    def state(self) -> dict[str, Any]:
        """What plays now, its level, and the levels at the places of the exposure profile in dB."""
        state = {"level": self.level, "late": self._late, "failsafe": self._failsafe}
        if (now := self._now) is None:
            return state | {"playing": None, "seconds": 0.0, "drive": 0.0, "places_db": {}}
        loaded, number, gain, intensity = now
        levels = loaded.levels[number % loaded.drive.frames] + 20 * np.log10(max(gain, 1e-9))
        places = zip(self._settings.exposure.profile.places, levels, strict=True)
        loud = {place.name: round(float(each), 1) for place, each in places if each > 0}
        state |= {"playing": loaded.about["file"], "seconds": number / loaded.drive.rate}
        return state | {"drive": intensity / 255, "places_db": loud}

    def run(self) -> None:
        """Send silent frames, and play each trigger."""
        while True:
            if self.triggers.empty():
                self._now = None
                self.silent.set()
            try:
                trigger = self.triggers.get(timeout=WORD)
            except queue.Empty:
                self._quiet(self._array.units.now() + round(1e9 * self._array.hold))
                continue
            if trigger is None:
                return
            self._play(*trigger)

    def _put(self, put: Callable[..., None], *frame: Any) -> None:
        try:
            put(*frame)
        except SilentFramesError:  # the program was held up for 50 ms; the next frame sounds again
            self._failsafe += 1
            self._array.resume()

    def _play(self, loaded: SimpleNamespace, repeats: int, token: LeaseToken) -> None:
        """Play to the end, or until the next trigger or the end of the lease."""
        units, rate, frames = self._array.units, loaded.drive.rate, loaded.drive.frames
        period, ahead, step = divider(rate) * TICK, round(1e9 * min(self._array.hold, 5 / rate)), 1 / (rate * FADE)
        soon, early, block = min(ahead, 500_000), 1_000_000, max(1, round(FollowRules().block * rate))
        if loaded.follower is not None:
            loaded.follower.fall_silent()
            early *= 4
        self.silent.clear()
        loaded.report["plays"] += 1
        first = -(-(units.now() + ahead + early) // period) * period
        number, begin, end, gain, phases, intensities = 0, 0, 0, self.level, np.zeros(0), np.zeros(0)
        before = loaded.report["duration"]
        while not repeats or number < repeats * frames:
            if self.permit.refusal(token) is not None:
                return self._array.silence()
            if not self.triggers.empty():
                return None
            if (missed := -(-(units.now() + soon - first - number * period) // period)) > 0:
                # The units keep the frame before.
                self._late, number = self._late + missed, number + missed
                continue
            if number >= end:
                at = number % frames
                begin, end = number, number + min(block, frames - at)
                clock = first + time.monotonic_ns() - units.now()
                times = 1e-9 * (clock + np.arange(begin, end) * period)
                phases, intensities = loaded.frames(slice(at, at + end - begin), times)
            wait_until(units, first + number * period - ahead)
            gain += min(max(self.level - gain, -step), step)
            intensity = int(intensities[number - begin] * gain)
            self._put(loaded.put, phases[number - begin], intensity, first + number * period)
            self._now = loaded, number, gain, intensity
            number += 1
            loaded.report["duration"] = before + number / rate
        wait_until(units, first + number * period - ahead)
        return self._quiet(first + number * period)


class _Server(asyncio.DatagramProtocol):
    """Answers clients that have the key, and lets one of them control the player; `report` gets a line a refusal."""

    def __init__(self, player: _Player, folder: Path, key: str, report: Callable[[str], object]) -> None:
        self._player, self._folder, self._key, self._report = player, folder.resolve(), key.encode(), report
        self._clients: dict[Any, SimpleNamespace] = {}
        self._control: SimpleNamespace | None = None
        self._osc: asyncio.DatagramTransport | None = None
        self._entered = self._refused = 0
        self._tasks, self._loading = set[asyncio.Task[None]](), asyncio.Lock()

    async def run(self, host: str, ports: tuple[int, int], ready: Callable[[int, int], object], playing: Any) -> None:
        """Serve until it is cancelled, or the future `playing` ends."""
        loop = asyncio.get_running_loop()
        # Its own lines about bad connections are left out.
        how: dict[str, Any] = {"logger": logging.Logger("quiet", logging.CRITICAL + 1), "process_request": self._check}
        how |= {"max_size": 65536, "compression": None, "close_timeout": 1, "ping_interval": 5, "ping_timeout": LEAVES}
        try:
            self._osc, _ = await loop.create_datagram_endpoint(lambda: self, (host, ports[1]))
            async with serve_websockets(self._talk, host, ports[0], **how) as tcp:
                ready(next(iter(tcp.sockets)).getsockname()[1], self._osc.get_extra_info("sockname")[1])
                self._tasks.add(asyncio.create_task(self._send_states()))
                await asyncio.wrap_future(playing)
        except OSError as wrong:
            if isinstance(wrong, MidairError):  # a lost link
                raise
            raise DeviceError(f"serve: expected free ports at {host}, got {wrong.strerror}; choose others") from wrong
        finally:
            self._player.permit.stop()
            if self._osc is not None:
                self._osc.close()

    async def _send_states(self) -> None:
        due = time.monotonic()
        while True:
            now = time.monotonic()
            for place in [each for each in self._clients if isinstance(each, tuple)]:
                if now - self._clients[place].seen > LEAVES:
                    self._leave(place)
            state = self._player.state() | {"control": getattr(self._control, "number", None)}
            for client in self._clients.values():
                client.send("state", state | {"clients": len(self._clients), "you": client.number})
            due = max(due + 1 / STATES, now)
            await asyncio.sleep(due - now)

    def _check(self, connection: ServerConnection, request: Request) -> Response | None:
        if compare_digest(request.path.encode(errors="replace"), b"/?key=" + self._key):
            return None
        self._refuse("a connection without the key")
        return connection.respond(401, "midair serve: expected the address with its ?key=\n")

    async def _talk(self, connection: ServerConnection) -> None:
        """Serve one WebSocket client until it leaves or floods."""
        client = self._enter(connection, lambda name, found: broadcast([connection], json.dumps({name: found})))
        alive = asyncio.create_task(self._watch(client, connection))
        try:
            async for text in connection:
                self._answer(client, partial(read_json, text))
        except (ConnectionClosed, InputError):
            pass
        finally:
            alive.cancel()
            self._leave(connection)

    async def _watch(self, client: SimpleNamespace, connection: ServerConnection) -> None:
        """Renew the lease of a client while it answers pings, as WebSocket clients do by themselves."""
        with suppress(ConnectionClosed):
            while True:
                await (await connection.ping())
                self._lives(client)
                await asyncio.sleep(LEASE / 5)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Answer an OSC packet."""
        try:
            for key, name, fields in read_osc(data):
                if compare_digest(key.encode(), self._key):
                    client = self._clients.get(addr) or self._enter(addr, partial(self._send_osc, addr))
                    self._answer(client, lambda name=name, fields=fields: (name, fields))
                elif name == "stop":
                    self._player.permit.stop()
                else:
                    raise InputError("expected the key as the first value, got another")
        except InputError as wrong:
            self._refuse(f"OSC: {wrong}")

    def _send_osc(self, addr: tuple[str, int], name: str, found: dict[str, Any]) -> None:
        numbers = [float(found.get(each) or 0) for each in ("seconds", "level", "drive", "control", "late")]
        values = [found["playing"] or "", *numbers] if name == "state" else [json.dumps(found)]
        if self._osc is not None:
            self._osc.sendto(osc_packet(f"/midair/{name}", *values), addr)

    def _enter(self, place: Any, send: Callable[[str, dict[str, Any]], None]) -> SimpleNamespace:
        self._entered += 1
        counts: Any = {"number": self._entered, "seen": time.monotonic(), "second": 0, "count": 0, "gone": False}
        self._clients[place] = client = SimpleNamespace(send=send, **counts)
        return client

    def _leave(self, place: Any) -> None:
        client = self._clients.pop(place)
        client.gone = True
        self._lose_control(client)

    def _lose_control(self, client: SimpleNamespace) -> None:
        if client is self._control:
            self._control = None
            self._player.permit.stop()

    def _lives(self, client: SimpleNamespace) -> None:
        client.seen = time.monotonic()
        if client is self._control and self._player.permit.armed:
            self._player.permit.renew(lasts=LEASE)

    def _refuse(self, why: str) -> None:
        self._refused += 1
        if self._refused <= LINES:
            self._report(f"refused: {why}" + "; no more of these lines" * (self._refused == LINES))

    def _answer(self, client: SimpleNamespace, read: Callable[[], tuple[str, Any]]) -> None:
        """Begin to do what a message asks, in the order of their arrival; InputError if there are too many."""
        client.count = client.count + 1 if (now := int(time.monotonic())) == client.second else 1
        client.second = now
        if client.count > MOST:
            self._lose_control(client)
            self._refuse(wrong := f"client {client.number}: expected at most {MOST} messages a second, got more")
            raise InputError(wrong)
        task = asyncio.create_task(self._do(client, read))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _do(self, client: SimpleNamespace, read: Callable[[], tuple[str, Any]]) -> None:
        name, found, player, held = "", dict[str, Any](), self._player, self._control
        if client.gone or client.count > MOST:
            return
        try:
            name, message = read()
            self._lives(client)
            if held is not client and name not in ("stop", "list"):
                if held is not None and time.monotonic() - held.seen < LEASE:
                    raise DeviceStateError(f"{name}: expected control, client {held.number} has it; a stop is allowed")
                player.permit.stop()
                self._control = client
            match name:
                case "stop":
                    player.permit.stop()
                    found = {"silent": await asyncio.to_thread(player.silent.wait, 1.0)}
                case "list":
                    files = sorted(each.name for each in self._folder.iterdir() if each.name.endswith(ENDINGS))
                    found = {"files": files[:1000], "loaded": [one.about for one in player.loaded.values()]}
                case "load":
                    path = (self._folder / message.file).resolve()
                    if path.parent != self._folder or not path.name.endswith(ENDINGS) or not path.is_file():
                        raise InputError(f"file: expected one of the list, got {message.file[:60]!r}")
                    async with self._loading:
                        found = await asyncio.to_thread(player.load, path, message.duration, message.follow)
                case "play":
                    loaded, passes = player.trigger(message.file, message.repeats), message.repeats or "endless"
                    await asyncio.to_thread(loaded.log, "trigger", f"client {client.number}, {passes} passes")
                case "level":
                    player.level = message.level
                case "palm":
                    player.palm.add(RawPose(stamp=time.monotonic(), values=message.pose, confidence=message.confidence))
                    return
                case "release":
                    self._lose_control(client)
                case _:
                    pass
        except (MidairError, ValueError, OSError) as wrong:
            if isinstance(wrong, FileError) and name == "play":  # nothing plays without a log
                player.permit.stop()
            self._refuse(f"client {client.number}: {wrong}")
            found = {"error": str(wrong)}
        client.send("answer", {"to": name} | found)


def serve(
    folder: Path,
    *,
    key: str,
    settings: PlaySettings | None = None,
    host: str = "127.0.0.1",
    ports: tuple[int, int] = (8700, 8701),
    report: Callable[[str], object] = print,
    ready: Callable[[int, int], object] = lambda _port, _osc_port: None,
) -> None:
    """Let clients with the `key` play the files of a folder on an array until Ctrl-C, `midair stop` or an error.

    `ports` are those for WebSocket and OSC; 0 chooses a free one, and `ready` gets both. DeviceError if a port is in
    use or the array is lost, StoppedError after `midair stop`.
    """
    chosen = settings or PlaySettings()
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: expected a folder of drives and patterns, got none")
    array = immediate_array(chosen, RATE)
    array.cooling, array.participant = chosen.cooling, chosen.participant
    with (
        signals_end_the_program(),
        array,
        array.drives_to_come() as (quiet, begin),
        (player := _Player(array, chosen, quiet, begin)).tracker,
        ThreadPoolExecutor(1) as pool,
    ):
        playing = pool.submit(player.run)
        try:
            with suppress(KeyboardInterrupt, asyncio.CancelledError):
                asyncio.run(_Server(player, folder, key, report).run(host, ports, ready, playing))
        finally:
            player.permit.stop()
            player.triggers.put(None)
            playing.result()
