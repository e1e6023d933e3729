import time

import numpy as np
import pytest
import soundfile
from PIL import Image

from midair.cli import run as midair
from midair.errors import BrokenFileError, FileError, InputError, MismatchError, MissingFileError
from midair.study import StudyFolder, check_digests, open_stimulus_rig, prepare_media, read_design
from midair.study.design import Stimulus, draw_plan
from midair.study.session import SilentPresenter, TextPresenter

PLAN = """
name = "media"
participants = 1
seed = 1
[[questions]]
name = "rough"
kind = "slider"
text = "How rough?"
[[stimuli]]
name = "word"
kind = "text"
source = "sandpaper"
duration_s = 0.2
[[stimuli]]
name = "photo"
kind = "picture"
source = "a.png"
[[stimuli]]
name = "noise"
kind = "sound"
source = "b.wav"
[[blocks]]
name = "one"
stimuli = ["word", "photo", "noise"]
questions = ["rough"]
"""


@pytest.fixture
def source(tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    Image.new("RGB", (4, 3)).save(tmp_path / "a.png")
    soundfile.write(tmp_path / "b.wav", np.zeros(80), 8000)
    return tmp_path


def test_media_are_copied_with_their_digests_and_a_change_is_refused(source, capsys):
    assert midair(["study", "new", str(source / "s"), "--source", str(source / "plan.toml")]) == 0
    assert "Next: midair studio" in capsys.readouterr().out
    folder = StudyFolder(source / "s")
    plan = folder.plan()
    assert set(plan.drives) == {"a.png", "b.wav"}
    assert (folder.path / "a.png").read_bytes() == (source / "a.png").read_bytes()
    check_digests(folder.path, plan.drives, plan.design.stimuli)
    (folder.path / "a.png").write_bytes(b"other")
    with pytest.raises(MismatchError, match="expected the picture of the plan"):
        check_digests(folder.path, plan.drives, plan.design.stimuli)


def test_a_terminal_refuses_pictures_before_the_session_starts(source):
    plan = draw_plan(read_design(PLAN))
    with (
        pytest.raises(InputError, match="got a picture, which a terminal cannot present; run this study in the studio"),
        open_stimulus_rig("none", StudyFolder(source), plan),
    ):
        pass


def test_a_text_is_shown_for_its_duration():
    shown, inner = [], SilentPresenter()
    one = TextPresenter(inner=inner, show=lambda text: shown.append((text, time.monotonic())))
    one.present(Stimulus(name="word", kind="text", source="sandpaper", duration_s=0.2))
    one.present(Stimulus(name="nothing", kind="silence"))
    assert [text for text, _ in shown] == ["sandpaper", ""]
    assert shown[1][1] - shown[0][1] >= 0.2
    assert inner.felt == ("nothing",)


@pytest.mark.parametrize(
    ("name", "content", "error"),
    [("a.png", b"no picture", BrokenFileError), ("b.wav", b"no sound", BrokenFileError), ("a.png", None, FileError)],
)
def test_files_that_are_no_media_or_too_large_are_refused(source, name, content, error):
    if content is None:
        with (source / name).open("ab") as file:
            file.truncate(20_000_001)
    else:
        (source / name).write_bytes(content)
    with pytest.raises(error, match=name):
        prepare_media(read_design(PLAN), source / "into", found_in=source)


def test_a_missing_file_is_named(source):
    (source / "b.wav").unlink()
    (source / "into").mkdir()
    with pytest.raises(MissingFileError, match=r"b.wav: expected the sound in"):
        prepare_media(read_design(PLAN), source / "into", found_in=source)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"kind": "picture", "source": "a.txt"}, "expected a picture"),
        ({"kind": "sound", "source": "../a.wav"}, "below the plan's folder"),
        ({"kind": "text"}, "expected the source of the text"),
        ({"kind": "text", "source": "a", "duration_s": 0}, "duration_s above 0 to 3600 s, got 0 s"),
    ],
)
def test_invalid_media_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        Stimulus(name="a", **settings)
