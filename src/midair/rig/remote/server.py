"""The server of remote control: clients over WebSocket and OSC, one of them in control, and the state for all."""

import asyncio
import json
import logging
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from hmac import compare_digest
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import Request, Response, ServerConnection, broadcast
from websockets.asyncio.server import serve as serve_websockets
from websockets.exceptions import ConnectionClosed

from midair.devices import RawPose, virtual_immediate
from midair.errors import DeviceError, DeviceStateError, FileError, InputError, MidairError
from midair.model import RATE
from midair.patterns import PATTERN_ENDINGS
from midair.rig.playing import PlaySettings, immediate_array
from midair.rig.remote.messages import osc_packet, read_json, read_osc
from midair.rig.remote.remote_player import LEASE, RemotePlayer
from midair.rig.signals import signals_end_the_program

STATES, MOST, LARGEST = 60, 1000, 65536
"""States that each client gets a second; messages of one client a second; bytes of a message."""
ENDINGS = (".drive.h5", *PATTERN_ENDINGS)
LINES, LEAVES = 20, 5.0
"""Number of refusals that are printed; time in s without a sign of life after which a client has left."""


@dataclass(slots=True, eq=False)
class _Client:
    number: int
    send: Callable[[str, dict[str, Any]], None]
    seen: float = 0.0
    second: int = 0
    count: int = 0

    def check_rate(self) -> None:
        """Count a message; InputError if there are too many in this second."""
        self.count = self.count + 1 if (now := int(time.monotonic())) == self.second else 1
        self.second = now
        if self.count > MOST:
            raise InputError(f"expected at most {MOST} messages a second, got more")


class RemoteServer(asyncio.DatagramProtocol):
    """Answers clients that have the key, and lets one of them control the player; `report` gets a line a refusal."""

    def __init__(self, player: RemotePlayer, folder: Path, key: str, report: Callable[[str], object]) -> None:
        self._player, self._folder, self._key, self._report = player, folder.resolve(), key.encode(), report
        self._clients: dict[Any, _Client] = {}
        self._osc: asyncio.DatagramTransport | None = None
        self._control: _Client | None = None
        self._entered = self._refused = 0
        self._tasks, self._loading = set[asyncio.Task[None]](), asyncio.Lock()

    async def run(self, host: str, port: int, osc_port: int, ready: Callable[[int, int], object]) -> None:
        """Serve until it is cancelled or the player ends."""
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        how: dict[str, Any] = {"max_size": LARGEST, "compression": None, "ping_interval": 5, "ping_timeout": LEAVES}
        # Its own lines about bad connections are left out.
        how |= {"logger": logging.Logger("websockets", logging.CRITICAL + 1), "process_request": self._check_key}
        try:
            self._osc, _ = await loop.create_datagram_endpoint(lambda: self, (host, osc_port))
            self._player.ended = lambda: loop.call_soon_threadsafe(task.cancel) if task else None
            async with serve_websockets(self._talk, host, port, **how) as tcp:
                ready(next(iter(tcp.sockets)).getsockname()[1], self._osc.get_extra_info("sockname")[1])
                await self._send_states()
        except OSError as wrong:
            raise DeviceError(f"serve: expected free ports at {host}, got {wrong.strerror}; choose others") from wrong
        finally:
            self._player.ended = lambda: None
            self._player.stop()
            if self._osc is not None:
                self._osc.close()

    async def _send_states(self) -> None:
        due = time.monotonic()
        while True:
            now = time.monotonic()
            for place in [each for each in self._clients if isinstance(each, tuple)]:
                if now - self._clients[place].seen > LEAVES:
                    self._leave(place)
            control = None if self._control is None else self._control.number
            state = self._player.state() | {"control": control, "clients": len(self._clients)}
            for client in self._clients.values():
                client.send("state", state | {"you": client.number})
            due = max(due + 1 / STATES, now)
            await asyncio.sleep(due - now)

    def _check_key(self, connection: ServerConnection, request: Request) -> Response | None:
        given = parse_qs(urlsplit(request.path).query).get("key", [""])[0]
        if compare_digest(given.encode(errors="replace"), self._key):
            return None
        self._refuse("a connection without the key")
        return connection.respond(HTTPStatus.UNAUTHORIZED, "midair serve: expected the address with its ?key=\n")

    async def _talk(self, connection: ServerConnection) -> None:
        """Serve one WebSocket client until it leaves."""
        client = self._enter(connection, lambda name, found: broadcast([connection], json.dumps({name: found})))
        alive = asyncio.create_task(self._watch(client, connection))
        try:
            async for text in connection:
                client.check_rate()
                self._answer(client, partial(read_json, text))
        except ConnectionClosed:
            pass
        except InputError as wrong:
            self._refuse(f"client {client.number}: {wrong}")
        finally:
            alive.cancel()
            self._leave(connection)

    async def _watch(self, client: _Client, connection: ServerConnection) -> None:
        """Renew the lease of a client while it answers pings, as WebSocket clients do by themselves."""
        with suppress(ConnectionClosed):
            while True:
                await (await connection.ping())
                self._lives(client)
                await asyncio.sleep(LEASE / 5)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Answer an OSC packet."""
        try:
            for key, message in read_osc(data):
                if not compare_digest(key.encode(), self._key):
                    if message.do != "stop":
                        raise InputError("expected the key as the first value, got another")
                    self._player.stop()
                    continue
                client = self._clients.get(addr) or self._enter(addr, partial(self._send_osc, addr))
                client.check_rate()
                self._answer(client, lambda message=message: message)
        except InputError as wrong:
            if addr in self._clients:
                self._lose_control(self._clients[addr])
            self._refuse(f"OSC: {wrong}")

    def _send_osc(self, addr: tuple[str, int], name: str, found: dict[str, Any]) -> None:
        numbers = [float(found.get(each) or 0) for each in ("seconds", "level", "drive", "control", "late")]
        values = [found["playing"] or "", *numbers] if name == "state" else [json.dumps(found)]
        if self._osc is not None:
            self._osc.sendto(osc_packet(f"/midair/{name}", *values), addr)

    def _enter(self, place: Any, send: Callable[[str, dict[str, Any]], None]) -> _Client:
        self._entered += 1
        self._clients[place] = client = _Client(self._entered, send, time.monotonic())
        return client

    def _leave(self, place: Any) -> None:
        self._lose_control(self._clients.pop(place))

    def _lose_control(self, client: _Client) -> None:
        if client is self._control:
            self._control = None
            self._player.stop()

    def _lives(self, client: _Client) -> None:
        client.seen = time.monotonic()
        if client is self._control:
            self._player.renew()

    def _refuse(self, why: str) -> None:
        self._refused += 1
        if self._refused <= LINES:
            self._report(f"refused: {why}" + "; no more of these lines" * (self._refused == LINES))

    def _answer(self, client: _Client, read: Callable[[], Any]) -> None:
        """Do what a message asks, in the order of their arrival; answer when it is done."""
        task = asyncio.create_task(self._do(client, read))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _do(self, client: _Client, read: Callable[[], Any]) -> None:
        name, found, player = "", dict[str, Any](), self._player
        try:
            message = read()
            name = message.do
            self._lives(client)
            if name == "stop":
                player.stop()
                found = {"silent": await asyncio.to_thread(player.silent.wait, 1.0)}
            elif name == "list":
                files = sorted(each.name for each in self._folder.iterdir() if each.name.endswith(ENDINGS))
                found = {"files": files[:1000], "loaded": [one.described() for one in player.loaded.values()]}
            else:
                self._take_control(client, name)
            if name == "load":
                path = (self._folder / message.file).resolve()
                if path.parent != self._folder or not path.name.endswith(ENDINGS) or not path.is_file():
                    raise InputError(f"file: expected one of the list, got {message.file[:60]!r}")
                async with self._loading:
                    found = await asyncio.to_thread(player.load, path, message.duration, message.follow)
            elif name == "play":
                loaded, passes = player.trigger(message.file, message.repeats), message.repeats or "endless"
                found = await asyncio.to_thread(loaded.described, f"client {client.number}, {passes} passes")
            elif name == "level":
                player.level = message.level
            elif name == "palm":
                player.palm.add(RawPose(stamp=time.monotonic(), values=message.pose, confidence=message.confidence))
            elif name == "release":
                self._lose_control(client)
        except MidairError as wrong:
            if name == "play" and isinstance(wrong, FileError):  # nothing plays without a log
                player.stop()
            self._refuse(f"client {client.number}: {wrong}")
            found = {"error": str(wrong)}
        client.send("answer", {"to": name} | found)

    def _take_control(self, client: _Client, name: str) -> None:
        held = self._control
        if held is not client:
            if held is not None and time.monotonic() - held.seen < LEASE:
                raise DeviceStateError(f"{name}: expected control, client {held.number} has it; a stop is allowed")
            self._player.stop()
            self._control = client


def serve(
    folder: Path,
    *,
    key: str,
    settings: PlaySettings | None = None,
    host: str = "127.0.0.1",
    port: int = 8700,
    osc_port: int = 8701,
    report: Callable[[str], object] = print,
    ready: Callable[[int, int], object] = lambda _port, _osc_port: None,
) -> None:
    """Let clients with the `key` play the files of a folder on an array until Ctrl-C, `midair stop` or an error.

    `ready` gets both ports; 0 chooses free ones. Raises DeviceError if a port is in use or the array is lost,
    StoppedError after `midair stop`.
    """
    chosen = settings or PlaySettings()
    array = virtual_immediate(chosen.placement) if chosen.device == "virtual" else immediate_array(chosen, RATE)
    array.cooling, array.participant = chosen.cooling, chosen.participant
    ended = suppress(KeyboardInterrupt, asyncio.CancelledError)
    with signals_end_the_program(), array, RemotePlayer(array, chosen) as player, ended:
        asyncio.run(RemoteServer(player, folder, key, report).run(host, port, osc_port, ready))
