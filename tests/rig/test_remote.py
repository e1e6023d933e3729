"""Remote control: what clients can do, and what they cannot, over real sockets on this computer."""

import json
import re
import shutil
import socket
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from benchmarks.live_outside import frames_on
from benchmarks.remote import (
    KEY,
    Here,
    OscClient,
    ask,
    attack,
    design,
    designer,
    flood,
    hold_palm,
    state,
    trigger_times,
)
from pythonosc.osc_bundle_builder import OscBundleBuilder
from pythonosc.osc_message_builder import build_msg
from tests.waiting import wait_until
from websockets.exceptions import InvalidStatus

from midair.devices import VirtualUnits, measure_exposure, read_log, stop_playing, virtual_immediate
from midair.errors import StoppedError
from midair.files import save_palm_path
from midair.model import Acoustics, Medium, PalmPath, TransducerArray
from midair.patterns import load_adaptics
from midair.physics import focus_phase
from midair.rig import FramePlayer, OpenRig, PlaySettings, Session, default_exposure, opening, serve_adaptics
from midair.rig.remote import adaptics
from midair.rig.remote.messages import MESSAGES

ARRAY, AIR = TransducerArray.autd3(), Acoustics(medium=Medium.at())
CIRCLE = Path(__file__).parents[1] / "patterns" / "adaptics" / "circle-grow.adaptics"
PAGE = (Path(__file__).parents[2] / "docs" / "remote.md").read_text(encoding="utf-8")


@pytest.fixture
def served(tmp_path, monkeypatch):
    units = VirtualUnits(kept=100_000)
    monkeypatch.setattr(opening, "immediate_array", lambda *_, **__: virtual_immediate(units=units))
    with closing(Here(tmp_path, units)) as one:
        yield one


@pytest.mark.long
def test_a_script_loads_plays_sets_the_level_and_stops(served):
    with served.playing() as client:
        found = ask(client, "list")
        assert (found["files"], [one["seconds"] for one in found["loaded"]]) == (["tap.toml"], [0.1])
        loud = max(intensity for _, intensity, _ in list(served.units.frames))
        wait_until(lambda: state(client)["playing"] == "tap.toml")
        assert "level: Input should be a valid number, got '1'" in ask(client, "level", level="1")["error"]
        ask(client, "level", level=0.5)
        wait_until(lambda: served.units.frames[-1][1] == int(0.5 * loud))
        told = state(client)
        assert (told["level"], told["control"], told["you"], told["places_db"]["palm"] > 100) == (0.5, 1, 1, True)
        assert ask(client, "stop") == {"to": "stop", "silent": True}
        assert not served.sounds()
        ask(client, "play", file="tap.toml")
        wait_until(served.sounds)
        wait_until(lambda: not served.sounds() and state(client)["playing"] is None)
    served.close()
    log = read_log()[0]
    assert [each["event"] for each in log] == ["play", "trigger", "trigger", "end"]
    assert (log[-1]["outcome"], log[-1]["plays"], log[-1]["duration_s"] > 0.1) == ("played", 2, True)


@pytest.mark.long
def test_osc_does_the_same(served):
    with OscClient(served.osc) as osc:
        osc.send("load", KEY, "tap.toml")
        assert json.loads(osc.heard("/midair/answer", "seconds")[0])["seconds"] == 0.1
        osc.send("play", KEY, "tap.toml", 0.0)
        wait_until(served.sounds)
        osc.send("level", KEY, 0.25)
        wait_until(lambda: 0 < served.units.frames[-1][1] < 10)
        assert len(osc.heard("/midair/state", "tap.toml")) == 6
        osc.send("level", "wrong", 1.0)
        wait_until(lambda: any("the key" in line for line in served.lines))
        osc.send("stop")  # a stop needs no key
        wait_until(lambda: not served.sounds())


def osc_bundle(ahead, *messages):
    builder = OscBundleBuilder(datetime.now(UTC).timestamp() + ahead)
    for each in messages:
        builder.add_content(each)
    return builder.build()


@pytest.mark.long
def test_every_osc_packet_that_can_be_answered_is_answered_and_values_keep_their_places(served):
    def load(*values):
        return osc.ask(build_msg("/midair/load", [KEY, "tap.toml", *values]).dgram)

    play, level = build_msg("/midair/play", [KEY, "tap.toml", 0]), build_msg("/midair/level", [KEY, 0.5])
    with OscClient(served.osc) as osc:
        found = [load(*values) for values in ((0.05, True), (None, False))]
        assert [(each["seconds"], each["follow"]) for each in found] == [(0.05, True), (0.1, False)]
        assert "duration: expected no boolean, got True" in load(True)["error"]
        assert (
            "repeats: expected no boolean"
            in osc.ask(build_msg("/midair/play", [KEY, "tap.toml", False]).dgram)["error"]
        )
        assert "type tags" in osc.ask(build_msg("/midair/level", [KEY, [0.1]]).dgram)["error"]
        wrong = [b"junk", b"#bundle\0" + bytes(8) + b"\xff\xff\xff\xfc", build_msg("/midair/level", ["no", 1]).dgram]
        assert [osc.ask(each)["to"] for each in wrong] == 3 * [""]
        nested = osc_bundle(-5, osc_bundle(-60, level))
        assert osc.ask(nested.dgram) == {"to": "level"}
        for ahead, packet in ((60, play), (1.5, nested)):
            assert "dated at most 1 s ahead" in osc.ask(osc_bundle(ahead, packet).dgram)["error"]
        assert osc.ask(play.dgram) == {"to": "play"}
        wait_until(served.sounds)
        for stop in (build_msg("/midair/stop"), osc_bundle(60, build_msg("/midair/stop", [KEY]))):
            assert osc.ask(stop.dgram) == {"to": "stop", "silent": True}
            assert not served.sounds()


@pytest.mark.long
def test_a_bundle_that_is_dated_ahead_waits_in_order_and_a_stop_before_its_time_ends_it(served):
    stop, play = build_msg("/midair/stop", [KEY]), build_msg("/midair/play", [KEY, "tap.toml", 0])
    with OscClient(served.osc) as osc:
        osc.ask(build_msg("/midair/load", [KEY, "tap.toml"]).dgram)
        began = time.monotonic()
        assert osc.ask(osc_bundle(0.3, stop, play).dgram) == {"to": "play"}
        assert time.monotonic() - began > 0.25
        wait_until(served.sounds)
        osc.heard("/midair/answer", "stop")
        assert osc.ask(osc_bundle(0.3, play).dgram) == {"to": "play"}
        osc.sendto(osc_bundle(0.3, play).dgram, served.osc)
        assert osc.ask(stop.dgram) == {"to": "stop", "silent": True}
        assert "expected no stop" in json.loads(osc.heard("/midair/answer", "play")[0])["error"]
        assert not served.sounds()


@pytest.mark.long
def test_the_next_pass_takes_a_parameter_without_a_step(served):
    with served.playing() as client:
        loud, begin = served.units.frames[-1][1], len(served.units.frames)
        for value in (5.0, 80.0):
            found = ask(client, "parameter", file="tap.toml", name="force", value=value)
            assert found["parameters"] == {"force": value}
            wait_until(lambda value=value: abs(served.units.frames[-1][1] - loud * np.sqrt(value / 20)) < 2)
        # 5 frames from full level to silence, two of which a busy computer may leave out, and steps of 1 of 255.
        levels = np.array([intensity for _, intensity, _ in list(served.units.frames)[begin:]])
        assert (levels.min(), np.abs(np.diff(levels)).max() <= 3 * levels.max() / 5 + 1) == (0, True)
        for name, value, said in (("force", 81.0, "force: expected 0.01 to 80, got 81"), ("f", 1.0, "one of force")):
            assert said in ask(client, "parameter", file="tap.toml", name=name, value=value)["error"]
        assert ask(client, "list")["loaded"][0]["parameters"] == {"force": 80.0}
        assert served.sounds()


@pytest.mark.long
def test_what_is_triggered_while_another_plays_rises_from_silence(served):
    """One drive from the middle of another is no moment that was checked."""
    with served.playing() as client:
        wait_until(lambda: len(served.units.frames) > 50)
        begin = len(served.units.frames)
        ask(client, "play", file="tap.toml", repeats=0)
        wait_until(lambda: len(served.units.frames) > begin + 50)
        levels = np.array([intensity for _, intensity, _ in list(served.units.frames)[begin:]])
    # Of five frames from silence to the full level, a busy computer may leave out two.
    assert (levels.min(), np.diff(levels).max() <= 3 * levels.max() / 5 + 1) == (0, True)


@pytest.mark.long
def test_a_second_client_cannot_play_but_can_stop(served):
    with served.playing() as first, served.client() as second:
        for message in ({"do": "level", "level": 0.1}, {"do": "play", "file": "tap.toml"}, {"do": "release"}):
            assert "client 1 has it" in ask(second, **message)["error"]
        assert (state(second)["level"], served.sounds()) == (1.0, True)
        assert ask(second, "stop")["silent"]
        assert not served.sounds()
        ask(first, "release")
        assert "error" not in ask(second, "play", file="tap.toml")
        assert state(first)["control"] == 2


@pytest.mark.long
@pytest.mark.parametrize("way", ["hangs", "goes", "floods"])
def test_a_client_that_hangs_goes_or_floods_ends_in_silence_and_another_gets_control(served, way):
    with served.playing() as client:
        began = time.monotonic()
        if way == "hangs":
            client.send_data = lambda: None  # no pong leaves
        elif way == "goes":
            client.socket.shutdown(socket.SHUT_RDWR)
        else:
            began = flood(client)
        wait_until(lambda: not served.sounds())
        assert (0.2 if way == "hangs" else 0) < time.monotonic() - began < (0.7 if way == "hangs" else 0.3)
        with served.client() as other:
            assert "error" not in ask(other, "control")
            assert not served.sounds()


@pytest.mark.long
def test_midair_stop_ends_the_server(served):
    with served.playing():
        stop_playing()
        assert isinstance(served.end.exception(10), StoppedError)
    assert [each["outcome"] for each in read_log()[0] if each["event"] == "end"] == ["stopped"]


@pytest.mark.parametrize("count", [100, pytest.param(10_000, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", ["served", "designed"])
def test_hostile_messages_make_no_sound_and_few_lines(request, kind, count):
    served = request.getfixturevalue(kind)
    if kind == "served":
        with served.client() as good:
            ask(good, "load", file="tap.toml")
        for key in ("", "wrong", "%00%ff"):
            with pytest.raises(InvalidStatus):
                served.client(key)
    assert attack(served, count) == count
    assert not any(intensity for _, intensity, _ in served.units.frames)
    assert len(served.lines) == 20
    assert all(len(line) < 500 and "\n" not in line for line in served.lines)


@pytest.fixture
def designed(tmp_path, monkeypatch):
    units = VirtualUnits(kept=100_000)
    monkeypatch.setattr(opening, "immediate_array", lambda *_, **__: virtual_immediate(units=units))
    with closing(Here(tmp_path, units, serve=partial(serve_adaptics, port=0))) as one:
        yield one


@pytest.mark.long
@pytest.mark.parametrize("way", ["stops", "goes", "sends another", "is no page of this computer"])
def test_the_designer_plays_its_pattern_until_it(designed, way):
    if way.startswith("is"):
        with pytest.raises(InvalidStatus):
            designed.client(origin="https://example.org")
        return
    with designed.client(origin="http://localhost:8123") as client:
        design(client, CIRCLE.read_text(encoding="utf-8"), grow=1.0)
        wait_until(designed.sounds)
        found = []
        while len(found) < 200:
            found += json.loads(client.recv(10))["data"].get("evals", [])
        phases = next(phases for phases, intensity, _ in reversed(list(designed.units.frames)) if intensity)
        told = np.array([[one["ul_control_point"]["coords"][axis] for axis in "xyz"] for one in found])
        places = np.array([load_adaptics(CIRCLE, {}).evaluate(one["pattern_time"]).place for one in found])
        assert told == pytest.approx(places)
        exact = np.stack([focus_phase(ARRAY, 1e-3 * place, acoustics=AIR) for place in places])
        off = np.exp(1j * (phases.ravel() * np.pi / 128 - exact))
        assert np.abs(np.angle(off / off.mean(axis=1, keepdims=True))).max(axis=1).min() < 0.05
        if way == "stops":
            designer(client, "update_playstart", playstart=0, playstart_offset=0.0)
        elif way == "goes":
            client.socket.shutdown(socket.SHUT_RDWR)
        else:
            assert "expected a pattern" in designer(client, "update_pattern", pattern_json="{}")["error"]
        wait_until(lambda: not designed.sounds())


@pytest.mark.long
def test_the_designer_gets_the_palm_while_it_is_tracked(tmp_path, monkeypatch):
    time_ = np.arange(0, 120, 0.02)
    still = np.tile([0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 1.0], (len(time_), 1))
    rows = np.column_stack([time_, 1e-4 * time_, 2e-4 * time_, 0.2 + 0 * time_, still])
    save_palm_path(PalmPath.from_rows(rows), tmp_path / "palm.csv")
    units = VirtualUnits(kept=1000)
    monkeypatch.setattr(opening, "immediate_array", lambda *_, **__: virtual_immediate(units=units))
    how = {"serve": partial(serve_adaptics, port=0), "follow": f"replay:{tmp_path / 'palm.csv'}"}
    with closing(Here(tmp_path, units, **how)) as one, one.client() as client:

        def hand():
            while (found := json.loads(client.recv(10)))["cmd"] != "tracking_data":
                pass
            return found["data"]["tracking_frame"]["hand"]

        seen = [each for each in (hand() for _ in range(20)) if each]
        monkeypatch.setattr(adaptics, "PATIENCE", -1.0)
        wait_until(lambda: hand() is None)
    places = np.array([list(each["palm"]["position"].values()) for each in seen])
    assert (np.diff(places[:, 0]) >= 0).all()
    assert np.ptp(places[:, 0]) > 0
    assert places[:, 1:] == pytest.approx(np.column_stack([2 * places[:, 0], 200 + 0 * places[:, 0]]), abs=1e-3)
    assert (seen[0]["palm"]["normal"]["z"], seen[0]["palm"]["direction"]["y"]) == (-1, 1)
    assert [len(digit["bones"]) for digit in seen[0]["digits"]] == 5 * [4]


def test_the_heat_of_the_designers_frames_is_that_of_a_minute_at_the_highest_level():
    """A pattern is not known ahead, and plays without an end: 128 frames of it were a duty of .0004."""
    array = virtual_immediate(units=VirtualUnits(kept=1))
    with array, array.drives_to_come() as (quiet, begin):
        player = FramePlayer(Session(rig=OpenRig(array=array, sensor=None)), quiet, begin)
        cleared = adaptics.Stream(player, 50.0, None, print)._clearance
    assert cleared.exposure.duty == pytest.approx(cleared.level, rel=0.05)
    assert cleared.level > 0.1


@pytest.mark.long
@pytest.mark.parametrize("choices", [{"attenuate": True}, {"override": "A Person"}], ids=["weaker", "overridden"])
def test_frames_of_the_designer_that_jump_are_no_louder_in_time_than_allowed(choices):
    """Each alone is allowed; while one follows another from an unlike place, they are 3 dB louder together."""
    array, rng = virtual_immediate(units=VirtualUnits(kept=1)), np.random.default_rng(7)
    array.gated = True
    exposure = replace(default_exposure(), **choices)
    settings = PlaySettings(exposure=exposure)
    with array, array.drives_to_come() as (quiet, begin):
        player = FramePlayer(Session(rig=OpenRig(array=array, sensor=None, settings=settings)), quiet, begin)
        stream = adaptics.Stream(player, 50.0, None, print)
        jumping = stream._drawn(rng.uniform(*adaptics.PLACES, (192, 3)), np.full(192, 50.0))
        frames = stream._clearance.steered(jumping, None)
    allowed = max(0.0, stream._clearance.exposure.sound_excess) if exposure.override else 0.0
    alone, moments = (measure_exposure(frames, array.array, exposure.profile, alone=each) for each in (True, False))
    assert alone.sound_excess < moments.sound_excess - 1 < allowed - 1


@pytest.mark.long
@pytest.mark.parametrize("attenuate", [False, True])
def test_the_designer_sounds_on_emulated_units_only_within_the_profile(tap, tmp_path, attenuate):
    choices = replace(default_exposure(), attenuate=attenuate)
    how = {"serve": partial(serve_adaptics, port=0), "device": f"autd3:{tap.address}", "exposure": choices}
    if not attenuate:
        with pytest.raises(AssertionError, match="raised ExposureError"):
            Here(tmp_path, None, **how)
        return
    with closing(Here(tmp_path, None, **how)) as one, one.client() as client:
        design(client, CIRCLE.read_text(encoding="utf-8"))
        wait_until(lambda: any(intensity for _, _, intensity, _ in frames_on(tap)))
        time.sleep(0.5)
        (order,) = [each for each in read_log()[0] if each["event"] == "play"]
        assert max(intensity for _, _, intensity, _ in frames_on(tap)) <= round(255 * order["level"])


def test_the_page_names_every_message_and_field():
    for name, kind in MESSAGES.items():
        (row,) = re.findall(rf"^\| `{name}` \| (.*) \|$", PAGE, re.MULTILINE)
        assert [each for each in re.findall(r"`(\w+)`", row) if each in kind.model_fields] == [*kind.model_fields]


@pytest.mark.long
@pytest.mark.parametrize("language", ["python", "javascript", "csharp"])
def test_the_clients_of_the_page_run(served, language, tmp_path):
    programs = {"python": [sys.executable], "javascript": ["node", "--experimental-websocket", "--no-warnings"]}
    program = programs.get(language, ["mono"])
    if (
        not shutil.which(program[0])
        or (language == "csharp" and not shutil.which("mcs"))
        or subprocess.run([*program, "--version"], check=False).returncode
    ):
        pytest.skip("no Node.js with WebSocket, or no Mono, here")
    (code,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    (tmp_path / "client.mjs").write_text(code, encoding="utf-8")
    if language == "csharp":
        (tmp_path / "client.mjs").rename(tmp_path / "client.cs")
        subprocess.run(["mcs", "-out:client.mjs", "client.cs"], cwd=tmp_path, check=True)
    line = [*program, tmp_path / "client.mjs", served.url + KEY]
    told = subprocess.run(line, capture_output=True, text=True, timeout=60, check=True).stdout
    assert [word in told for word in ("rate_hz", "play", "silent", "error")] == [True, True, True, False]
    assert any(intensity for _, intensity, _ in served.units.frames)
    assert not served.sounds()


@pytest.mark.long
def test_frames_follow_the_palm_that_clients_report(served):
    with served.client() as client:
        assert ask(client, "load", file="tap.toml", follow=True)["follow"]
        ask(client, "play", file="tap.toml", repeats=0)
        time.sleep(0.1)
        assert not served.sounds()
        for x in (0.0, 0.01):
            hold_palm(client, x)
            assert served.sounds()
            exact = focus_phase(ARRAY, np.array([x, 0.0, 0.2]), acoustics=AIR)
            off = np.exp(1j * (served.units.frames[-1][0].ravel() * np.pi / 128 - exact))
            assert np.abs(np.angle(off / off.mean())).max() < 0.2
        wait_until(lambda: not served.sounds())  # no more poses


@pytest.mark.clock
@pytest.mark.long
@pytest.mark.parametrize(("attenuate", "force"), [(False, 20), (True, 20), (False, 0.01)])
def test_on_emulated_units_the_check_decides_and_a_trigger_is_on_the_wire_in_time(tap, tmp_path, attenuate, force):
    choices = replace(default_exposure(), attenuate=attenuate)
    served = Here(tmp_path, None, device=f"autd3:{tap.address}", exposure=choices, force=force)
    with closing(served), served.client() as client:
        loaded = ask(client, "load", file="tap.toml")
        times = trigger_times(tap, client, 200 if attenuate else 1)
        if attenuate:
            assert np.median(times) < 0.02
            (order,) = [each for each in read_log()[0] if each["event"] == "play"]
            assert max(intensity for _, _, intensity, _ in frames_on(tap)) <= round(255 * order["level"])
        elif force < 1:
            ask(client, "play", file="tap.toml", repeats=0)
            found = ask(client, "parameter", file="tap.toml", name="force", value=20.0)
            assert "--attenuate plays it weaker" in found["error"]
            assert state(client)["playing"] == "tap.toml"
            assert 0 < max(intensity for _, _, intensity, _ in frames_on(tap)) < 5
        else:
            assert "--attenuate plays it weaker" in loaded["error"]
            assert np.isnan(times[0])
