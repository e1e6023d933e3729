import re
import tomllib

import numpy as np
import pytest

from midair.cli import console, run
from midair.cli.console import duration_text, estimate_text, progress_bars, remember_speed
from midair.files import save
from midair.model import Recording


@pytest.fixture
def stored(monkeypatch, tmp_path):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    return tmp_path / "state" / "speeds.toml"


def test_the_last_speeds_of_a_kind_give_a_range(monkeypatch, stored):
    assert "no time estimate" in estimate_text("solve exact", 3000)
    monkeypatch.setattr("os.getloadavg", lambda: (0.5, 0, 0))
    remember_speed("solve exact", 100, 10.0)
    remember_speed("play", 100, 1.0)
    assert estimate_text("solve exact", 3000) == "this takes about 5 min, by the last run on this machine"
    for seconds in (1.0, 20.0, 10.0, 10.0, 10.0, 15.0):
        remember_speed("solve exact", 100, seconds)
    assert estimate_text("solve exact", 3000) == "this takes 5 min to 10 min, by the last 5 runs on this machine"
    monkeypatch.setattr("os.getloadavg", lambda: (1000.0, 0, 0))
    assert estimate_text("solve exact", 3000).endswith("; longer now, since other programs use the processors")
    assert estimate_text("solve exact", 30) == ""
    assert "no time estimate" in estimate_text("solve glide", 3000)


def test_work_too_short_to_measure_is_not_stored(stored):
    remember_speed("play", 100, 0.1)
    remember_speed("play", 0, 10.0)
    assert not stored.exists()


@pytest.mark.parametrize(
    ("seconds", "words"), [(3.4, "3 s"), (44.4, "44 s"), (100, "1.7 min"), (3300, "55 min"), (9000, "2.5 h")]
)
def test_durations_are_printed_in_two_digits(seconds, words):
    assert duration_text(seconds) == words


def test_a_file_that_cannot_be_read_or_written_is_ignored(monkeypatch, stored):
    remember_speed("play", 3000, 10.0)
    assert tomllib.loads(stored.read_text()) == {"play": [300.0]}
    stored.write_text("play = 30.0")
    assert "about 1.7 min" in estimate_text("play", 3000), "one number, as early versions stored"
    stored.write_text("rates = [")
    assert "no time estimate" in estimate_text("play", 3000)
    monkeypatch.setenv("MIDAIR_STATE", str(stored))
    remember_speed("play", 3000, 10.0)


def test_finished_work_gives_the_next_estimate(monkeypatch, capsys, stored):
    monkeypatch.setattr(console, "MEASURED", 0.0)
    with progress_bars("solve exact", 3000) as stage:
        stage("solve, pass 1")(3000, 3000)
    assert "no time estimate yet" in capsys.readouterr().err
    rate = tomllib.loads(stored.read_text())["solve exact"][-1]
    with progress_bars("solve exact", round(40 * rate)):
        pass
    assert "this takes about 40 s" in capsys.readouterr().err


def test_interrupted_work_stores_no_speed(monkeypatch, stored):
    monkeypatch.setattr(console, "MEASURED", 0.0)
    with pytest.raises(KeyboardInterrupt), progress_bars("solve exact", 3000) as stage:
        stage("solve")(10, 3000)
        raise KeyboardInterrupt
    assert not stored.exists()


@pytest.mark.long
def test_a_slow_method_is_tried_before_it_starts(stored, capsys):
    save(Recording(samples=np.random.default_rng(1).normal(size=(60, 4, 4)), rate=1000, unit="Pa"), "take.h5")
    words = ["solve", "take.h5", "--mode", "paper", "--method", "lm", "--points", "6", "--pitch", "9mm", "--lead", "0s"]
    assert run(words) == 0
    told = capsys.readouterr().err
    assert re.search(r"this takes about [\d.e-]+ (s|min), by a trial of 8 frames", told)
    assert "no time estimate" not in told
