import re
import sys
import webbrowser

import pytest
from PIL import Image
from tests.view.shown import focus_drive, focus_target, recording

from midair.cli import run
from midair.files import save, save_solution
from midair.model import Calibration, Solution


@pytest.fixture(autouse=True)
def files(tmp_path):
    take = recording(200)
    save(take, "take.h5", calibration=Calibration.flat(take.sensor, sensitivity=0.02))
    save(take, "again.h5", calibration=Calibration.flat(take.sensor, sensitivity=0.02))
    save(take, "raw.h5")
    status = ("converged",) * 7 + ("silent",)
    solution = Solution(drive=focus_drive(), error=[0.1] * 7 + [0], iterations=[1] * 8, status=status)
    save_solution(solution, "take.drive.h5", target=focus_target())
    return tmp_path


def test_each_kind_of_file_becomes_a_page(files, capsys):
    for line, page, held in (
        ("take.h5", "take.show.html", {"samples"}),
        ("raw.h5", "raw.show.html", {"samples"}),
        ("take.drive.h5", "take.drive.show.html", {"wanted", "played", "phases"}),
        ("take.h5 again.h5 --save both.html", "both.html", {"samples", "again"}),
        ("take.h5 --target -o asked.html", "asked.html", {"wanted"}),
    ):
        assert run(["show", *line.split()]) == 0
        text = (files / page).read_text(encoding="utf-8")
        assert set(re.findall(r'data-name="(\w+)"', text)) == held | {"about"}, line
        said = capsys.readouterr().out
        assert page in said
        assert re.search(r"(kB|MB), in \d+\.\d s", said), line


@pytest.mark.long
def test_its_own_page_is_made_again_and_others_are_kept(files, capsys):
    for line, text in (
        ("show take.h5", "200 frames at 1000 Hz, 0.2 s"),
        ("show take.h5 --start-at 0.05s --duration 0.1s", "100 frames at 1000 Hz, 0.1 s"),
    ):
        assert run(line.split()) == 0
        assert f'<p class="lead">{text}</p>' in (files / "take.show.html").read_text(encoding="utf-8")
    (files / "mine.html").write_text("a page of mine")
    assert run(["show", "take.h5", "--save", "mine.html"]) == 1
    assert "--force" in capsys.readouterr().err
    assert (files / "mine.html").read_text() == "a page of mine"


@pytest.mark.long
def test_a_film_prints_its_duration(files, capsys):
    assert run(["show", "take.drive.h5", "--save", "film.gif"]) == 0
    with Image.open(files / "film.gif") as made:
        assert made.n_frames == 8
    assert "film of 8 pictures, 0.16 s, 20 times slower" in capsys.readouterr().out


def test_a_channel_becomes_a_sound(files, capsys):
    assert run(["show", "take.h5", "--save", "wave.wav", "--channel", "6"]) == 0
    assert (files / "wave.wav").read_bytes()[:4] == b"RIFF"
    assert "channel 6; full scale is" in capsys.readouterr().out


@pytest.mark.long
def test_no_browser_opens_without_a_screen(files, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setenv("DISPLAY", ":0")
    assert run(["show", "take.h5"]) == 0
    assert opened == []
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert run(["show", "take.h5", "--no-browser"]) == 0
    assert opened == []
    assert run(["show", "take.h5"]) == 0
    assert opened == [(files / "take.show.html").resolve().as_uri()]


def test_without_ffmpeg_the_message_comes_before_the_work(files, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(files))
    assert run(["show", "take.h5", "--save", "film.mp4"]) == 1
    assert "needs ffmpeg" in capsys.readouterr().err
    assert not (files / "film.mp4").exists()
