import threading
import time
from pathlib import Path

import numpy as np
import soundfile

from midair.studio.panels.study_panel import PagePresenter
from midair.study import Stimulus


def presenter(**changes):
    said = []
    made = PagePresenter(
        **{
            "play": lambda path, share: said.append(("play", path, share)),
            "wait": lambda seconds: said.append(("wait", seconds)),
            "stop": lambda: said.append(("stop",)),
            "tell": lambda words: said.append(("tell", words)),
            "folder": Path("study"),
        }
        | changes
    )
    return made, said


def test_player_presents_drives_and_silences():
    made, said = presenter(quiet_s=1.5)
    made.present(Stimulus(name="a", source="a.drive.h5", share=0.25))
    made.present(Stimulus(name="b", kind="silence"))
    assert said == [("play", Path("study/a.drive.h5"), 0.25), ("wait", 1.5)]


def test_experimenter_presents_objects_and_confirms():
    made, said = presenter()
    threading.Timer(0.05, made.done.set).start()
    made.present(Stimulus(name="a", kind="object", source="towel"))
    assert said == [("tell", "present: towel"), ("tell", "")]


def test_texts_and_sounds_last_as_long_as_stated(tmp_path):
    soundfile.write(tmp_path / "tone.wav", np.zeros(800), 8000)
    shown = []
    made, _ = presenter(show=lambda media: shown.append((media, time.monotonic())), folder=tmp_path)
    made.present(Stimulus(name="a", kind="text", source="rough", duration_s=0.2))
    made.present(Stimulus(name="b", kind="sound", source="tone.wav"))
    text, sound = {"kind": "text", "source": "rough"}, {"kind": "sound", "source": "tone.wav"}
    assert [media for media, _ in shown] == [text, None, sound, None]
    times = [at for _, at in shown]
    assert times[1] - times[0] >= 0.2
    assert times[3] - times[2] >= 0.1


def test_a_stop_ends_a_picture():
    shown = []
    made, _ = presenter(show=shown.append)
    threading.Timer(0.05, made.silence).start()
    made.present(Stimulus(name="a", kind="picture", source="a.png", duration_s=3000))
    assert shown[-1] is None


def test_a_stop_ends_the_wait_for_the_experimenter():
    made, said = presenter()
    threading.Timer(0.05, made.silence).start()
    made.present(Stimulus(name="b", kind="silence"))
    assert said[-1] == ("stop",)
    assert "present nothing" in said[0][1]
