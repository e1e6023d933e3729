"""Another terminal silences what plays; nobody else does."""

import json
import os
import socket

import pytest

from midair.devices.safety.state_folders import make_state_folder
from midair.devices.safety.stop_lines import stop_line, stop_playing


def test_another_terminal_silences_what_plays():
    silenced = []
    with stop_line("a device", lambda: silenced.append(True)) as path:
        assert path.stat().st_mode & 0o077 == 0
        (stopped,) = stop_playing()
    assert silenced == [True]
    assert (stopped.device, stopped.outcome) == ("a device", "silent")
    assert stop_playing() == []


def test_without_the_secret_nobody_silences():
    silenced = []
    with stop_line("a device", lambda: silenced.append(True)) as path:
        entry = json.loads(path.read_text(encoding="utf-8"))
        path.write_text(json.dumps({**entry, "secret": "guess"}), encoding="utf-8")
        (stopped,) = stop_playing(timeout=0.3)
    assert silenced == []
    assert stopped.outcome == "no answer"


def test_a_player_that_died_is_told_and_forgotten():
    folder = make_state_folder()
    (folder / "playing-1.json").write_text('{"process": 1, "device": "d", "port": 9, "secret": "s"}', encoding="utf-8")
    (folder / "playing-2.json").write_text("{", encoding="utf-8")
    assert [one.outcome for one in stop_playing()] == ["gone", "gone"]
    assert stop_playing() == []


def test_the_line_ends_with_the_block_also_when_it_fails():
    def fail():
        with stop_line("a device", lambda: None) as path:
            assert json.loads(path.read_text(encoding="utf-8"))["process"] == os.getpid()
            raise ValueError("the array went away")

    with pytest.raises(ValueError, match="went away"):
        fail()
    assert not list(make_state_folder().glob("playing-*"))


def test_noise_on_the_port_is_not_an_order():
    silenced = []
    with stop_line("a device", lambda: silenced.append(True)) as path:
        port = json.loads(path.read_text(encoding="utf-8"))["port"]
        for noise in (b"", b"\xff\xfe\n", b"silence\n", b"end\n", b"silence " + b"0" * 32 + b" more\n"):
            with socket.create_connection(("127.0.0.1", port), 1) as call:
                call.sendall(noise)
        assert silenced == []
        (stopped,) = stop_playing()
    assert stopped.outcome == "silent"


def test_the_port_is_not_open_to_other_computers():
    with stop_line("a device", lambda: None) as path:
        port = json.loads(path.read_text(encoding="utf-8"))["port"]
        # A port bound to every address would refuse to be bound on another one of this computer.
        with socket.socket() as other:
            other.bind(("127.0.0.2", port))
