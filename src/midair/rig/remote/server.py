"""The server of remote control: who may ask, who has control, and when the array is silent."""

import asyncio
import json
import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from hmac import compare_digest
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pythonosc.osc_message_builder import build_msg
from websockets.asyncio.server import Request, Response, ServerConnection, broadcast
from websockets.asyncio.server import serve as serve_websockets
from websockets.exceptions import ConnectionClosed

from midair.devices import RawPose, signals_end_the_program
from midair.errors import DeviceError, DeviceStateError, FileError, InputError, MidairError, MissingFileError
from midair.model import RATE
from midair.patterns import PATTERN_ENDINGS
from midair.rig.opening import frame_rig
from midair.rig.playing.play_settings import PlaySettings
from midair.rig.remote.messages import read_json, read_osc
from midair.rig.remote.player import LEASE, FramePlayer
from midair.rig.session import Session

LEAVES, AHEAD = 5.0, 1.0
"""Times in s: without a sign of life until any client has left; longest time that a dated message waits."""
STATES, MOST, LINES = 60, 1000, 20
"""States that each client gets a second; messages of one client a second; refusals that are printed."""
ENDINGS = (".drive.h5", *PATTERN_ENDINGS)
Message = str | bytes | tuple[str, BaseModel]
"""Text of a message, or its name and fields."""


@dataclass(slots=True, kw_only=True, eq=False)
class Client:
    """A client that has the key."""

    number: int
    send: Callable[[str, dict[str, Any]], None]
    """Sends an answer or a state."""
    seen: float = field(default_factory=time.monotonic)
    second: int = 0
    count: int = 0
    """Number of messages in that second."""
    gone: bool = False


class Server(asyncio.DatagramProtocol):
    """Answers clients that have the key, and lets one of them control the player; `report` gets a line a refusal."""

    free: tuple[str, ...] = ("stop", "list")
    """Messages that do not need control."""
    most_bytes, strict = 65536, False
    """Longest message; whether one that is refused silences the array."""
    read = staticmethod(read_json)

    def __init__(self, player: FramePlayer, folder: Path, key: str, report: Callable[[str], object]) -> None:
        self._player, self._folder, self._key, self._report = player, folder.resolve(), key.encode(), report
        self._clients: dict[Any, Client] = {}
        self._control: Client | None = None
        self._osc: asyncio.DatagramTransport | None = None
        self._entered = self._refused = 0
        self._strangers = Client(number=0, send=lambda _name, _found: None)
        """Counts the answers to OSC packets without the key, which any program could ask for in another's name."""
        self._stopped = 0.0
        """Time of the last stop on the clock of the event loop."""
        self._values: dict[str, dict[str, float]] = {}
        """Values of parameters by file, until they are set."""
        self._tasks, self._loading = set[asyncio.Task[None]](), asyncio.Lock()

    async def run(self, host: str, ports: Sequence[int], ready: Callable[..., object], playing: Any) -> None:
        """Serve until it is cancelled, or the future `playing` ends; without a second port there is no OSC."""
        loop = asyncio.get_running_loop()
        # Its own lines about bad connections are left out.
        how: dict[str, Any] = {"logger": logging.Logger("quiet", logging.CRITICAL + 1), "process_request": self.check}
        how |= {"compression": None, "close_timeout": 1, "ping_interval": 5, "ping_timeout": LEAVES}
        try:
            if len(ports) > 1:
                self._osc, _ = await loop.create_datagram_endpoint(lambda: self, (host, ports[1]))
            async with serve_websockets(self._talk, host, ports[0], max_size=self.most_bytes, **how) as tcp:
                udp = [] if self._osc is None else [self._osc.get_extra_info("sockname")[1]]
                ready(next(iter(tcp.sockets)).getsockname()[1], *udp)
                self._tasks.add(asyncio.create_task(self._send_states()))
                await asyncio.wrap_future(playing)
        except OSError as wrong:
            if isinstance(wrong, MidairError):  # a lost link
                raise
            raise DeviceError(f"serve: expected free ports at {host}, got {wrong.strerror}; choose others") from wrong
        finally:
            self._player.lease.stop()
            if self._osc is not None:
                self._osc.close()

    async def _send_states(self) -> None:
        due = time.monotonic()
        while True:
            now = time.monotonic()
            for place in [each for each in self._clients if isinstance(each, tuple)]:
                if now - self._clients[place].seen > LEAVES:
                    self._leave(place)
            self.send_states(self._player.state() | {"control": getattr(self._control, "number", None)})
            due = max(due + 1 / STATES, now)
            await asyncio.sleep(due - now)

    def send_states(self, state: dict[str, Any]) -> None:
        """Send a state to all clients."""
        for client in self._clients.values():
            client.send("state", state | {"clients": len(self._clients), "you": client.number})

    def text(self, name: str, found: dict[str, Any]) -> str:
        """An answer or a state as text."""
        return json.dumps({name: found})

    def check(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the response to a connection that is refused."""
        if compare_digest(request.path.encode(errors="replace"), b"/?key=" + self._key):
            return None
        self._refuse("a connection without the key")
        return connection.respond(401, "midair serve: expected the address with its ?key=\n")

    async def _talk(self, connection: ServerConnection) -> None:
        """Serve one WebSocket client until it leaves or floods."""
        client = self._enter(connection, lambda name, found: broadcast([connection], self.text(name, found)))
        alive = asyncio.create_task(self._watch(client, connection))
        try:
            async for text in connection:
                self._answer(client, text)
        except (ConnectionClosed, InputError):
            pass
        finally:
            alive.cancel()
            self._leave(connection)

    async def _watch(self, client: Client, connection: ServerConnection) -> None:
        """Renew the lease of a client while it answers pings, as WebSocket clients do by themselves."""
        with suppress(ConnectionClosed):
            while True:
                await (await connection.ping())
                self._lives(client)
                await asyncio.sleep(LEASE / 5)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Answer an OSC packet; a message of a bundle that is dated ahead waits for its time."""
        now, clock = time.monotonic(), datetime.now(UTC).timestamp()
        try:
            for number, (stamp, key, name, fields) in enumerate(read_osc(data)):
                ahead, message = 0.0 if stamp is None else stamp - clock, (name, fields)
                if not compare_digest(key.encode(), self._key):
                    if name != "stop":
                        raise InputError("expected the key as the first value, got another")
                    self._stop()
                    if not self._one_too_many(self._strangers):
                        self._begin(Client(number=0, send=partial(self._send_osc, addr)), message)
                    continue
                if ahead > AHEAD and name != "stop":
                    raise InputError(
                        f"{name}: expected a bundle that is dated at most {AHEAD:g} s ahead, got {ahead:.3g} s; "
                        "send it without a time, or set the clocks of both computers"
                    )
                client = self._clients.get(addr) or self._enter(addr, partial(self._send_osc, addr))
                # Messages of one bundle keep their order.
                self._answer(client, message, now + ahead + 1e-6 * number if 0 < ahead <= AHEAD else 0.0)
        except InputError as wrong:
            self._refuse(f"OSC: {wrong}")
            if not self._one_too_many(self._strangers):
                self._send_osc(addr, "answer", {"to": "", "error": str(wrong)})

    def _send_osc(self, addr: tuple[str, int], name: str, found: dict[str, Any]) -> None:
        numbers = [float(found.get(each) or 0) for each in ("seconds", "level", "drive", "control", "late")]
        values = [found["playing"] or "", *numbers] if name == "state" else [json.dumps(found)]
        if self._osc is not None:
            self._osc.sendto(build_msg(f"/midair/{name}", values).dgram, addr)

    def _enter(self, place: Any, send: Callable[[str, dict[str, Any]], None]) -> Client:
        self._entered += 1
        self._clients[place] = client = Client(number=self._entered, send=send)
        return client

    def _leave(self, place: Any) -> None:
        client = self._clients.pop(place)
        client.gone = True
        self._lose_control(client)

    def _lose_control(self, client: Client) -> None:
        if client is self._control:
            self._control = None
            self._player.lease.stop()

    def _lives(self, client: Client) -> None:
        client.seen = time.monotonic()
        if client is self._control and self._player.lease.armed:
            self._player.lease.renew(lasts=LEASE)

    def _refuse(self, why: str) -> None:
        self._refused += 1
        if self._refused <= LINES:
            self._report(f"refused: {why}" + "; no more of these lines" * (self._refused == LINES))

    def _one_too_many(self, client: Client) -> bool:
        """Count a message or an answer; whether it is one more than a client has in a second."""
        client.count = client.count + 1 if (now := int(time.monotonic())) == client.second else 1
        client.second = now
        return client.count > MOST

    def _answer(self, client: Client, message: Message, due: float = 0.0) -> None:
        """Do what a message asks, in the order of arrival, or when it is due; InputError if there are too many."""
        if self._one_too_many(client):
            self._lose_control(client)
            self._refuse(wrong := f"client {client.number}: expected at most {MOST} messages a second, got more")
            raise InputError(wrong)
        if due:
            asyncio.get_running_loop().call_at(due, self._begin_due, client, message, time.monotonic(), due)
        else:
            self._begin(client, message)

    def _begin_due(self, client: Client, message: Message, arrived: float, due: float) -> None:
        if arrived < self._stopped < due:
            client.send(
                "answer", {"to": message[0], "error": "expected no stop before the time of its bundle, got one"}
            )
        else:
            self._begin(client, message)

    def _begin(self, client: Client, message: Message) -> None:
        task = asyncio.create_task(self._do(client, message))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _stop(self) -> None:
        """Silence the array, whatever is due later."""
        self._player.lease.stop()
        self._stopped = time.monotonic()

    async def _do(self, client: Client, asked: Message) -> None:
        name, held = "", self._control
        if client.gone or client.count > MOST:
            return
        try:
            name, message = asked if isinstance(asked, tuple) else self.read(asked)
            self._lives(client)
            if held is not client and name not in self.free:
                if held is not None and time.monotonic() - held.seen < LEASE:
                    raise DeviceStateError(f"{name}: expected control, client {held.number} has it; a stop is allowed")
                self._player.lease.stop()
                self._control = client
            found = await self.act(client, name, message)
        except (MidairError, ValueError, OSError) as wrong:
            # Nothing plays without a log.
            if (isinstance(wrong, FileError) and name == "play") or (self.strict and client is self._control):
                self._player.lease.stop()
            self._refuse(f"client {client.number}: {wrong}")
            found = {"error": str(wrong)}
        if found is not None:
            client.send("answer", {"to": name} | found)

    async def act(self, client: Client, name: str, message: Any) -> dict[str, Any] | None:
        """Do what a message asks and return the answer, None for no answer."""
        player = self._player
        match name:
            case "stop":
                self._stop()
                return {"silent": await asyncio.to_thread(player.silent.wait, 1.0)}
            case "list":
                files = sorted(each.name for each in self._folder.iterdir() if each.name.endswith(ENDINGS))
                return {"files": files[:1000], "loaded": [one.about for one in player.loaded.values()]}
            case "load":
                path = (self._folder / message.file).resolve()
                if path.parent != self._folder or not path.name.endswith(ENDINGS) or not path.is_file():
                    raise InputError(f"file: expected one of the list, got {message.file[:60]!r}")
                async with self._loading:
                    return await asyncio.to_thread(player.load, path, message.duration, message.follow, {})
            case "parameter":
                player.loaded_file(message.file)
                self._values.setdefault(message.file, {})[message.name] = message.value
                async with self._loading:
                    old, values = player.loaded[message.file], self._values.pop(message.file, {})
                    if not values or old.again is None:  # set together with an earlier one
                        return old.about
                    return await asyncio.to_thread(old.again, old.about["parameters"] | values)
            case "play":
                loaded, passes = player.trigger(message.file, message.repeats), message.repeats or "endless"
                await asyncio.to_thread(loaded.log, "trigger", f"client {client.number}, {passes} passes")
            case "level":
                player.level = message.level
            case "palm":
                player.palm.add(RawPose(stamp=time.monotonic(), values=message.pose, confidence=message.confidence))
                return None
            case _:  # control was taken above
                if name == "release":
                    self._lose_control(client)
        return {}


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
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: expected a folder of drives and patterns, got none")
    play_and_serve(settings, lambda player: Server(player, folder, key, report), host, ports, ready)


def play_and_serve(
    settings: PlaySettings | None,
    server: Callable[[FramePlayer], Server],
    host: str,
    ports: Sequence[int],
    ready: Callable[..., object],
) -> None:
    """Run a server and the player of an array until Ctrl-C, `midair stop` or an error; then it is silent."""
    chosen = settings or PlaySettings()
    rig = frame_rig(chosen, RATE)
    with (
        signals_end_the_program(),
        rig,
        rig.frames.drives_to_come() as (quiet, begin),
        (player := FramePlayer(Session(rig=rig), quiet, begin)).tracker,
        ThreadPoolExecutor(1) as pool,
    ):
        playing = pool.submit(player.run)
        try:
            with suppress(KeyboardInterrupt, asyncio.CancelledError):
                asyncio.run(server(player).run(host, ports, ready, playing))
        finally:
            player.lease.stop()
            player.triggers.put(None)
            playing.result()
