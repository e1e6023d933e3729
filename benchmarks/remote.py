"""Time from a client's message to the datagram at emulated units, and to the instant at which its frame sounds.

`midair serve` runs as its own program; this one is client and wire. The clock of the
units is compared with that of this computer by silent frames, which are sent 6 ms ahead.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import numpy as np
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import build_msg
from tests.simulators.udp_proxy import UdpProxy
from tests.waiting import wait_until
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from benchmarks.live_outside import SILENT_PATTERN, frames_on, plain, watch_in_time
from midair.rig import PlaySettings
from midair.rig import serve as serve_files
from midair.rig.remote.messages import MESSAGES

PATTERN = """duration_s = {seconds}
rate_hz = {rate}
parameters = {{ force = {{ default = {force}, min = 0.01, max = 80.0 }} }}
[[spot]]
pressure_pa = "$force"
"""
KEY = "secret"
HOLD, TURN = 6_000, 2**32
"""Time by which silent frames are sent ahead of their instants, and where the clock of the units begins anew, in us."""


class Served:
    """`midair serve` of a folder on the units behind a tap."""

    def __init__(self, tap: UdpProxy, folder: Path) -> None:
        line = [sys.executable, "-m", "midair", "serve", str(folder), "--device", f"autd3:{tap.address}"]
        line += ["--ports", "0", "0", "--override-exposure", "emulated units"]
        self.process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True, preexec_fn=plain)
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().split()[1]
        words = self.process.stdout.readline().split()
        self.osc = ("127.0.0.1", int(words[1].rsplit(":", 1)[1]))
        self.key = words[3]

    def close(self) -> None:
        self.process.terminate()
        self.process.communicate(timeout=20)


def ask(client: ClientConnection, do: str, **fields: object) -> dict:
    """Answer to a message."""
    client.send(json.dumps({"do": do} | fields))
    while True:
        found = json.loads(client.recv(30))
        if found.get("answer", {}).get("to") in (do, ""):
            return found["answer"]


def wire(tap: UdpProxy, since: int, *, loud: bool, patience: float = 1.0) -> tuple[float, int]:
    """Time and instant in us of the first frame with or without sound after `since` datagrams."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        for at, _, datagram in tap.sent[since:]:
            if datagram[1] == 0 and datagram[5] == SILENT_PATTERN and (datagram[-249] > 0) == loud:
                return at, int.from_bytes(datagram[6:10], "little")
        time.sleep(0.0005)
    return np.nan, 0


class Here:
    """A server in a thread of this program, on virtual units that keep their frames, or on others."""

    def __init__(self, folder, units, *, force=20, serve=None, **settings):
        self.url, self.units, self.lines, ready = None, units, [], threading.Event()
        (folder / "tap.toml").write_text(PATTERN.format(seconds=0.1, rate=1000, force=force), encoding="utf-8")

        def note(tcp, udp=0):
            self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
            self.url, self.osc = f"ws://127.0.0.1:{tcp}/?key=", ("127.0.0.1", udp or 9)
            ready.set()

        how = {"settings": PlaySettings(**settings), "report": self.lines.append, "ready": note}
        self._pool = ThreadPoolExecutor(1)
        self.end = self._pool.submit(serve or partial(serve_files, folder, key=KEY, ports=(0, 0)), **how)
        self.end.add_done_callback(lambda _: ready.set())
        ready.wait(60)
        assert self.url, self.end

    def close(self):
        with suppress(RuntimeError):  # it has ended
            self._loop.call_soon_threadsafe(self._task.cancel)
        self._pool.shutdown()

    def sounds(self):
        """Whether the newest frame has sound."""
        return bool(self.units.frames) and self.units.frames[-1][1] > 0

    def client(self, key=KEY, origin=None):
        return connect(self.url + key, max_queue=None, close_timeout=0.2, origin=origin)

    @contextmanager
    def playing(self):
        with self.client() as client:
            assert "error" not in ask(client, "load", file="tap.toml")
            assert not self.sounds()
            assert "error" not in ask(client, "play", file="tap.toml", repeats=0)
            wait_until(self.sounds)
            yield client


def state(client):
    """The newest state."""
    ask(client, "list")
    while "state" not in (found := json.loads(client.recv(10))):
        pass
    return found["state"]


HUGE = ["1e308", "-1", "NaN", "Infinity", "9" * 400, "[]", "null", '"1"', "true", "{}"]
FIELDS = [f'{{"do": "{do}", "{name}": {each}}}' for do in MESSAGES for name in ("file", "level") for each in HUGE]
FILES = [f'{{"do": "load", "file": "{file}"}}' for file in ("../../etc/passwd", "a\\u0000.toml", "/etc/passwd")]
UPDATES = ("update_pattern", "update_playstart", "update_parameters", "update_tracking", "update_device")
DATA = [f'{{"cmd": "{cmd}", "data": {each}}}' for cmd in UPDATES for each in HUGE]
DATA += [f'{{"cmd": "update_pattern", "data": {{"pattern_json": {json.dumps(each)}}}}}' for each in [*HUGE, "[" * 9000]]
HOSTILE = [
    *FIELDS,
    *DATA,
    *FILES,
    *HUGE,
    "[" * 20_000,
    '{"do":' * 5000,
    '{"do": "play", "file": "tap.toml", "gain": 2}',
]
"""Messages that are none."""


def designer(client: ClientConnection, cmd: str, **data: object) -> dict:
    """Send a message as the AdapTics Designer does; return its answer."""
    client.send(json.dumps({"cmd": cmd, "data": data}))
    while True:
        found = json.loads(client.recv(30))
        if found["cmd"] == "ignoreme" and found["data"]["to"] in (cmd, "stop", ""):
            return found["data"]


def design(client: ClientConnection, pattern: str, **values: float) -> None:
    """Play a pattern from its beginning as the Designer does."""
    designer(client, "update_pattern", pattern_json=pattern)
    asked = {"time": 0.0, "user_parameters": values, "geometric_transform": np.eye(4).tolist()}
    designer(client, "update_parameters", evaluator_params=asked)
    designer(client, "update_playstart", playstart=1.0, playstart_offset=0.0)


def trigger_times(tap: UdpProxy, client: ClientConnection, count: int) -> list[float]:
    """Seconds from triggers to the wire."""
    times: list[float] = []
    for _ in range(count):
        tap.sent.clear()
        began = time.monotonic()
        client.send('{"do": "play", "file": "tap.toml"}')
        times.append(wire(tap, 0, loud=True, patience=0.5)[0] - began)
        ask(client, "stop")
    return times


def flood(client: ClientConnection) -> float:
    """Send plays until the server closes the connection; return that time."""
    with suppress(ConnectionClosed):
        for _ in range(100_000):
            client.send('{"do": "play", "file": "tap.toml", "repeats": 0}')
        raise RuntimeError("the server took 100,000 messages")
    return time.monotonic()


def hold_palm(client: ClientConnection, x: float) -> None:
    """Report a palm that is 0.2 m above the array, with a tremor of 30 um, for 0.3 s."""
    for step in range(30):
        pose = [x + 1e-6 * step, 0.0, 0.2, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0]
        client.send(json.dumps({"do": "palm", "pose": pose}))
        time.sleep(0.01)


class OscClient(socket.socket):
    """A client that writes and reads OSC by python-osc."""

    def __init__(self, server: tuple[str, int]) -> None:
        super().__init__(socket.AF_INET, socket.SOCK_DGRAM)
        self.server = server
        self.settimeout(10)

    def send(self, do: str, *values: object) -> None:
        self.sendto(build_msg(f"/midair/{do}", values).dgram, self.server)

    def ask(self, packet: bytes) -> dict:
        """The next answer to a packet."""
        self.sendto(packet, self.server)
        return json.loads(self.heard("/midair/answer", "")[0])

    def heard(self, name: str, word: str) -> list:
        """Values of the next message of a name whose text has a word."""
        while not ((found := OscMessage(self.recv(65536))).address == name and word in found.params[0]):
            pass
        return found.params


def attack(served: Here, count: int) -> int:
    """Send hostile messages over WebSocket and OSC; return how many were answered by an error."""
    answers, dice = 0, random.Random(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as osc:
        for number in range(0, count, 100):
            with served.client() as bad:
                for each in range(number, number + 100):
                    raw = dice.choice([dice.choice(HOSTILE).encode(), dice.randbytes(dice.randrange(300))])
                    bad.send(raw)
                    osc.sendto(raw[:5000], served.osc)
                    osc.sendto(build_msg(f"/midair/{each % 3}", [KEY, 1e9, "x" * 50]).dgram, served.osc)
                while answers < number + 100:
                    found = json.loads(bad.recv(10))
                    answers += "error" in found.get("answer", found.get("data", {}))
    return answers


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.remote", description=__doc__.splitlines()[0])
    parser.add_argument("--triggers", type=int, default=1000, help="number of triggers (default 1000)")
    parser.add_argument("--rates", type=float, nargs="*", default=[1000, 4000], help="frames per second (default both)")
    options = parser.parse_args()
    print(f"real-time priority of the tap: {watch_in_time()}")
    with tempfile.TemporaryDirectory() as name:
        for rate in options.rates:
            Path(name, "tap.toml").write_text(PATTERN.format(seconds=0.05, rate=rate, force=20), encoding="utf-8")
            tap = UdpProxy(4)
            served = Served(tap, Path(name))
            try:
                measure(tap, served, options.triggers, rate)
            finally:
                served.close()
                tap.close()


def measure(tap: UdpProxy, served: Served, triggers: int, rate: float) -> None:
    sent, sounds, silent, state = [], [], [], {}
    with connect(served.address) as client:
        assert "error" not in ask(client, "load", file="tap.toml")
        tap.sent.clear()
        time.sleep(1.0)
        # The wire takes at least no time: the units' clock minus that of this computer, within a fraction of 1 ms.
        ahead = max((instant - round(at * 1e6)) % TURN for at, instant, *_ in frames_on(tap)) - HOLD
        for _ in range(triggers):
            tap.sent.clear()
            began = time.monotonic()
            client.send(json.dumps({"do": "play", "file": "tap.toml", "repeats": 0}))
            at, instant = wire(tap, 0, loud=True)
            sent.append(at - began)
            sounds.append(((instant - round(began * 1e6) - ahead) % TURN) * 1e-6)
            time.sleep(0.02)
            begin, began = len(tap.sent), time.monotonic()
            client.send(json.dumps({"do": "stop"}))
            silent.append(wire(tap, begin, loud=False)[0] - began)
            time.sleep(0.015)
            while True:
                try:
                    state = json.loads(client.recv(0)).get("state", state)
                except TimeoutError:
                    break
    late = state["late"]
    print(f"{rate:g} frames a second, {triggers} triggers, {late} frames late; in ms: median, 99 %, most")
    for name, times in (
        ("trigger to wire", sent),
        ("trigger to sound", sounds),
        ("stop to silence on the wire", silent),
    ):
        print(f"  {name:28}" + " ".join(f"{1e3 * each:7.2f}" for each in np.percentile(times, [50, 99, 100])))


if __name__ == "__main__":
    main()
