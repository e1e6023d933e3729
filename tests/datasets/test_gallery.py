"""Touches to start from."""

import json
import re
import runpy
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PIL import Image

from midair.cli import run
from midair.datasets import TOUCHES
from midair.files import load
from midair.patterns import load_pattern


@pytest.mark.long
@pytest.mark.parametrize("name", ["ridges", "heartbeat"])
def test_a_touch_is_seen_heard_and_written(name, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    touch, view = TOUCHES[name], TOUCHES[name].view()
    assert view.simulated is (name == "heartbeat")
    assert run(["gallery", name, "--pictures", "pictures"]) == 0
    printed = capsys.readouterr().out
    assert touch.says.split()[0] in printed
    assert ("midair solve ridges.h5" if name == "ridges" else "midair draw heartbeat.toml") in printed
    assert run(["gallery", name, "other" + touch.ending, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["written"], told["felt"], told["ears"]) == ("other" + touch.ending, touch.felt, touch.ears)
    with Image.open(f"pictures/{name}.gif") as film, Image.open(f"pictures/{name}.png") as picture:
        assert film.n_frames == len(view.pictures)
        assert picture.size == (192, 192)
    sound, rate = soundfile.read(f"pictures/{name}.wav")
    assert (rate, np.abs(sound).max()) == (8000, pytest.approx(0.9, abs=0.01))
    assert len(sound) / rate == pytest.approx(len(view.pictures) / 50, abs=0.03)
    if name == "ridges":
        assert load("ridges.h5").provenance.notes["licence"] == touch.licence
    else:
        assert load_pattern("heartbeat.toml").foci().pressure.max() == 60


@pytest.mark.long
def test_every_touch_is_listed_and_the_sound_of_a_heartbeat_is_two_beats(capsys):
    assert run(["gallery"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in TOUCHES)
    loud = TOUCHES["heartbeat"].view().pictures.max(axis=(1, 2)) > 1
    assert np.diff(np.pad(loud, 1).astype(int)).clip(0).sum() == 2
    assert run(["gallery", "velvet"]) == 1
    assert "expected one of towel" in capsys.readouterr().err


@pytest.mark.long
def test_a_touch_says_who_feels_it_and_how_loud_it_is(capsys):
    some = ("towel", "tap", "heartbeat")
    runpy.run_path(str(Path(__file__).parents[2] / "docs" / "felt_tables.py"))["touches"](some, levels=())
    told = re.findall(r"^\| (\w+)(?: \*)? \| \d+ Pa \| \+(\d+) dB \| (\d+) \(", capsys.readouterr().out, re.MULTILINE)
    assert [(name, int(people), int(ears)) for name, ears, people in told] == [
        (name, TOUCHES[name].felt, TOUCHES[name].ears) for name in some
    ]
