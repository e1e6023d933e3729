"""Remote control: what clients can do, and what they cannot, over real sockets on this computer."""

import asyncio
import json
import random
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from benchmarks.live_outside import frames_on
from benchmarks.remote import wire
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import build_msg
from tests.waiting import wait_until
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from midair.devices import ExposureChoices, VirtualUnits, read_log, stop_playing, virtual_immediate
from midair.errors import InputError, StoppedError
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Acoustics, Medium, TransducerArray
from midair.physics import focus_phase
from midair.rig import PlaySettings, dose_report
from midair.rig import remote as server
from midair.rig.remote import MESSAGES, osc_packet, read_json, read_osc

TAP = "duration_s = 0.1\nrate_hz = 1000\n[[spot]]\npressure_pa = 20\n"
KEY = "a secret"


class Served:
    """A server in a thread, on virtual units that keep their frames."""

    def __init__(self, folder, device="virtual", **settings):
        self.units, self.lines, self.error, self._ready = VirtualUnits(kept=100_000), [], [], threading.Event()
        how = PlaySettings(device=device, **settings)
        self._thread = threading.Thread(target=self._run, args=(folder, how), daemon=True)
        self._thread.start()
        assert self._ready.wait(20), self.error

    def _run(self, folder, how):
        def ready(tcp, udp):
            self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
            self.url, self.osc = f"ws://127.0.0.1:{tcp}/?key=", ("127.0.0.1", udp)
            self._ready.set()

        try:
            ports = {"ports": (0, 0), "ready": ready}
            server.serve(folder, key=KEY, settings=how, report=self.lines.append, **ports)
        except BaseException as error:  # noqa: BLE001
            self.error.append(error)

    def close(self):
        if self._thread.is_alive():
            with suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(20)
        assert not self._thread.is_alive()

    def sounds(self):
        """Whether the newest frame has sound."""
        return bool(self.units.frames) and self.units.frames[-1][1] > 0

    def client(self, key=KEY):
        return connect(self.url + key.replace(" ", "%20"), max_queue=None, close_timeout=0.2)


@pytest.fixture
def served(tmp_path, monkeypatch):
    (tmp_path / "tap.toml").write_text(TAP, encoding="utf-8")
    made = []

    def virtual(placement):
        return virtual_immediate(placement, units=made[0].units)

    monkeypatch.setattr(server, "virtual_immediate", virtual)
    one = Served.__new__(Served)
    made.append(one)
    one.__init__(tmp_path)
    yield one
    one.close()


def ask(client, do, **fields):
    client.send(json.dumps({"do": do} | fields))
    return heard(client, lambda found: found.get("answer", {}).get("to") in (do, ""))["answer"]


def heard(client, what=lambda found: "state" in found):
    while not what(found := json.loads(client.recv(10))):
        pass
    return found


def state(client):
    """The newest state."""
    ask(client, "list")
    return heard(client)["state"]


def test_a_script_loads_plays_sets_the_level_and_stops(served):
    with served.client() as client:
        assert ask(client, "list") == {"to": "list", "files": ["tap.toml"], "loaded": []}
        loaded = ask(client, "load", file="tap.toml")
        assert (loaded["seconds"], loaded["rate_hz"], loaded["follow"]) == (0.1, 1000.0, False)
        assert not served.sounds()
        assert "error" not in ask(client, "play", file="tap.toml", repeats=0)
        wait_until(served.sounds)
        loud = max(intensity for _, intensity, _ in served.units.frames)
        wait_until(lambda: state(client)["playing"] == "tap.toml")
        ask(client, "level", level=0.5)
        wait_until(lambda: list(served.units.frames)[-1][1] == int(0.5 * loud))
        told = state(client)
        assert (told["level"], told["control"], told["you"]) == (0.5, 1, 1)
        assert told["places_db"]["palm"] > 100
        assert ask(client, "stop") == {"to": "stop", "silent": True}
        assert list(served.units.frames)[-1][1] == 0
        # A pass ends by itself, at the gain that is set.
        ask(client, "play", file="tap.toml")
        wait_until(served.sounds)
        wait_until(lambda: not served.sounds() and state(client)["playing"] is None)
    served.close()
    events = [each["event"] for each in read_log()[0]]
    assert events == ["play", "trigger", "trigger", "end"]
    end = read_log()[0][-1]
    assert (end["outcome"], end["plays"]) == ("played", 2)
    (order,) = dose_report().orders
    assert (order["duration_is"], order["duration_s"]) == ("at most", pytest.approx(end["duration_s"]))


def test_osc_does_the_same(served):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as osc:
        osc.settimeout(10)

        def send(do, *values):
            osc.sendto(build_msg(f"/midair/{do}", values).dgram, served.osc)

        def answer():
            while (found := OscMessage(osc.recv(65536))).address != "/midair/answer":
                pass
            return json.loads(found.params[0])

        send("load", KEY, "tap.toml")
        assert answer()["seconds"] == 0.1
        send("play", KEY, "tap.toml", 0.0)
        wait_until(served.sounds)
        send("level", KEY, 0.25)
        wait_until(lambda: 0 < list(served.units.frames)[-1][1] < 10)
        while not (found := OscMessage(osc.recv(65536))).address.endswith("state") or found.params[0] != "tap.toml":
            pass
        assert len(found.params) == 6
        send("level", KEY, float("nan"))
        send("level", "wrong", 1.0)
        send("stop")  # a stop needs no key
        wait_until(lambda: not served.sounds())
    wait_until(lambda: any("the key" in line for line in served.lines))


def test_a_second_client_cannot_play_but_can_stop(served):
    with served.client() as first, served.client() as second:
        ask(first, "load", file="tap.toml")
        ask(first, "play", file="tap.toml", repeats=0)
        wait_until(served.sounds)
        for message in ({"do": "level", "level": 0.1}, {"do": "play", "file": "tap.toml"}, {"do": "release"}):
            assert "client 1 has it" in ask(second, **message)["error"]
        assert state(second)["level"] == 1.0
        assert ask(second, "stop")["silent"]
        assert not served.sounds()
        ask(first, "release")
        assert "error" not in ask(second, "play", file="tap.toml")
        assert state(first)["control"] == 2


@contextmanager
def playing(served):
    with served.client() as client:
        ask(client, "load", file="tap.toml")
        ask(client, "play", file="tap.toml", repeats=0)
        wait_until(served.sounds)
        yield client


def test_a_client_that_hangs_loses_the_array_within_half_a_second_and_another_gets_it(served):
    with playing(served) as client:
        client.send_data = lambda: None  # no pong leaves
        began = time.monotonic()
        wait_until(lambda: not served.sounds())
        assert 0.2 < time.monotonic() - began < 0.7
        with served.client() as other:
            assert "error" not in ask(other, "control")


def test_a_client_that_is_gone_or_floods_ends_in_silence(served):
    with playing(served) as client:
        client.socket.shutdown(socket.SHUT_RDWR)
        wait_until(lambda: not served.sounds(), limit=0.3)
    with playing(served) as client:
        with pytest.raises(ConnectionClosed):
            for _ in range(100_000):
                client.send('{"do": "control"}')
        wait_until(lambda: not served.sounds(), limit=0.3)


def test_midair_stop_ends_the_server(served):
    with playing(served):
        stop_playing()
        wait_until(lambda: served.error)
    assert isinstance(served.error[0], StoppedError)
    assert [each["outcome"] for each in read_log()[0] if each["event"] == "end"] == ["stopped"]


def hostile(number):
    dice = random.Random(number)
    huge = dice.choice(["1e308", "-1", "NaN", "Infinity", "9" * 400, "[]", "null", '"1"', "true", "{}"])
    return dice.choice(
        [
            dice.randbytes(dice.randrange(300)),
            "[" * dice.randrange(20_000),
            '{"do":' * 5000,
            f'{{"do": "level", "level": {huge}}}',
            f'{{"do": "play", "file": {huge}, "repeats": {huge}}}',
            f'{{"do": "palm", "pose": [{huge}], "confidence": {huge}}}',
            f'{{"do": {huge}}}',
            '{"do": "load", "file": "../../etc/passwd"}',
            '{"do": "play", "file": "tap.toml", "gain": 2}',
        ]
    )


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.long)])
def test_hostile_messages_make_no_sound_and_few_lines(served, count):
    with served.client() as good, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as osc:
        ask(good, "load", file="tap.toml")
        sent, number = 0, 0
        while sent < count:
            with suppress(ConnectionClosed), served.client() as bad:
                for _ in range(500):
                    sent, number = sent + 1, number + 1
                    message = hostile(number)
                    bad.send(message)
                    osc.sendto(message.encode()[:5000] if isinstance(message, str) else message, served.osc)
                    osc.sendto(osc_packet(f"/midair/{number % 3}", KEY, 1e9, "x" * 50), served.osc)
                    if number % 50 == 0:
                        ask(bad, "list")
        for key in ("", "wrong", "%00%ff"):
            with pytest.raises(InvalidStatus):
                served.client(key)
        assert state(good)["control"] in (1, None) or state(good)["clients"] >= 1
        assert "error" not in ask(good, "list")
    assert not any(intensity for _, intensity, _ in served.units.frames)
    assert 0 < len(served.lines) <= 20
    assert all(len(line) < 500 and "\n" not in line for line in served.lines)


@given(st.binary(max_size=100), st.sampled_from([b"", b"#bundle\0", b"/midair/level\0\0\0,sf\0", b'{"do": "level",']))
def test_no_bytes_raise_another_error(data, head):
    for read in (read_json, lambda packet: list(read_osc(packet))):
        with suppress(InputError):
            read(head + data)


def test_a_bundle_of_python_osc_holds_several_messages():
    bundle = OscBundleBuilder(IMMEDIATELY)
    bundle.add_content(build_msg("/midair/level", ["k", 0.5]))
    bundle.add_content(build_msg("/midair/palm", ["k", *map(float, range(9)), 0.5]))
    (_, _, level), (key, name, palm) = read_osc(bundle.build().dgram)
    assert (level.level, key, name, palm.pose, palm.confidence) == (0.5, "k", "palm", [*map(float, range(9))], 0.5)


PAGE = Path(__file__).parents[2] / "docs" / "remote.md"


def test_the_page_names_every_message_and_field():
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    assert sorted(name for name in rows if name in MESSAGES) == sorted(MESSAGES)
    for name, kind in MESSAGES.items():
        assert [field for field in re.findall(r"`(\w+)`", rows[name]) if field in kind.model_fields] == list(
            kind.model_fields
        )


@pytest.mark.long
@pytest.mark.parametrize(
    ("language", "program"),
    [("python", [sys.executable]), ("javascript", ["node", "--experimental-websocket", "--no-warnings"])],
)
def test_the_clients_of_the_page_run(served, language, program, tmp_path):
    if shutil.which(program[0]) is None or (language == "javascript" and "websocket" not in node_options()):
        pytest.skip("no Node.js with WebSocket here")
    (code,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    (tmp_path / "client.mjs").write_text(code, encoding="utf-8")
    url = served.url + KEY.replace(" ", "%20")
    done = subprocess.run([*program, tmp_path / "client.mjs", url], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert [word in done.stdout for word in ("rate_hz", "play", "silent", "error")] == [True, True, True, False]
    assert any(intensity for _, intensity, _ in served.units.frames)
    assert not served.sounds()


def node_options():
    return subprocess.run(
        ["node", "-p", "process.allowedNodeEnvironmentFlags.has('--experimental-websocket') ? 'websocket' : ''"],
        capture_output=True,
        text=True,
    ).stdout


@pytest.mark.long
def test_frames_follow_the_palm_that_clients_report(served):
    with served.client() as client:
        assert ask(client, "load", file="tap.toml", follow=True)["follow"]
        ask(client, "play", file="tap.toml", repeats=0)
        time.sleep(0.1)
        assert not served.sounds()
        found = []
        for x in (0.0, 0.01):
            for step in range(30):
                pose = [x + 1e-6 * step, 0.0, 0.2, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0]
                client.send(json.dumps({"do": "palm", "pose": pose}))
                time.sleep(0.01)
            assert served.sounds()
            found.append(served.units.frames[-1][0].ravel())
        wait_until(lambda: not served.sounds())  # no more poses
    array = TransducerArray.autd3()
    for x, phases in zip((0.0, 0.01), found, strict=True):
        exact = focus_phase(array, np.array([x, 0.0, 0.2]), acoustics=Acoustics(medium=Medium.at()))
        off = np.angle(np.exp(1j * (phases * np.pi / 128 - exact)))
        assert np.abs(off - np.angle(np.exp(1j * off).mean())).max() < 0.2


@pytest.mark.long
def test_on_emulated_units_the_check_decides_and_a_trigger_is_on_the_wire_in_time(tap, tmp_path):
    (tmp_path / "tap.toml").write_text(TAP.replace("20", "200"), encoding="utf-8")
    device = f"autd3:{tap.address}"
    for more in ({}, {"attenuate": True}):
        served = Served(tmp_path, device, exposure=ExposureChoices(profile=profile_named(DEFAULT_PROFILE), **more))
        try:
            with served.client() as client:
                loaded = ask(client, "load", file="tap.toml")
                assert ("exposure" in loaded.get("error", "")) == (not more)
                if not more:
                    assert "expected one that is loaded" in ask(client, "play", file="tap.toml")["error"]
                    assert not any(intensity for _, _, intensity, _ in frames_on(tap))
                    continue
                times = []
                for _ in range(200):
                    tap.sent.clear()
                    began = time.monotonic()
                    client.send('{"do": "play", "file": "tap.toml"}')
                    times.append(wire(tap, 0, loud=True)[0] - began)
                    ask(client, "stop")
                assert np.median(times) < 0.02
                (order,) = [each for each in read_log()[0] if each["event"] == "play"]
                assert order["exposure"] == "attenuated"
                assert max(intensity for _, _, intensity, _ in frames_on(tap)) <= round(255 * order["level"])
        finally:
            served.close()
