import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import soundfile
from tests.drives import Loud, save_drive

from midair.devices import VirtualArray, autd3_array
from midair.errors import ExposureError, InputError, SilentFramesError
from midair.model import Drive, Placement, TransducerArray
from midair.rig import Session
from midair.study.design.question import Stimulus
from midair.study.session.presenters import SilentPresenter, StimulusPresenter
from midair.study.stimulus_rig import cleared_drives, on_array

ARRAY = TransducerArray.autd3(columns=1, rows=1)
TONE = Stimulus(name="a", source="a.drive.h5")
BRUSH = Stimulus(name="b", kind="object", source="brush")
NOTHING = Stimulus(name="n", kind="silence")


def drive(array=ARRAY):
    return Drive(phase=np.zeros((4, array.count)), level=np.ones(4), rate=1000.0, array=array)


def presenter(device, made, told):
    by_hand = StimulusPresenter(tell=told.append, done=lambda: told.append("done"), stop=lambda: told.append("stop"))
    session = Session.on(device, None, None)
    return on_array(by_hand, session, lambda _source, _share: session.clear(made))


def test_array_plays_drives_and_experimenter_presents_objects():
    told = []
    with VirtualArray(ARRAY) as device:
        one = presenter(device, drive(), told)
        one.present(TONE)
        assert told == []
        one.present(BRUSH)
        assert told == ["present: brush", "done"]
        one.present(NOTHING)
        one.silence()
    assert told[2:] == ["stop"]
    nobody = SilentPresenter()
    nobody.present(BRUSH)
    assert nobody.felt == ("b",)


class Noise:
    def __init__(self, told):
        self.on, self.off = (lambda: told.append("noise")), (lambda: told.append("quiet"))


def test_noise_masks_drives_and_silences_but_no_objects():
    told = []

    def done():
        if told[-1] == "present: a2.drive.h5":
            raise SilentFramesError("silent")

    one = StimulusPresenter(tell=told.append, done=done, stop=lambda: told.append("stop"), noise=Noise(told))
    for stimulus in (TONE, NOTHING, BRUSH):
        one.present(stimulus, lambda: told.append("begins"))
    assert told == [
        *("noise", "begins", "present: a.drive.h5", "quiet"),
        *("noise", "begins", "wait, present nothing", "quiet"),
        *("begins", "present: brush"),
    ]
    told.clear()
    with pytest.raises(SilentFramesError):
        one.present(replace(TONE, source="a2.drive.h5"))
    one.silence()
    assert (told[:3], told[3:]) == (["noise", "present: a2.drive.h5", "quiet"], ["stop", "quiet"])


def test_silence_has_the_duration_of_drives_and_ends_at_a_stop():
    with VirtualArray(ARRAY) as device:
        one = replace(presenter(device, drive(), []), silence_s=0.05)
        begin = time.monotonic()
        one.present(NOTHING)
        assert time.monotonic() - begin >= 0.05
        long = replace(one, silence_s=30.0)
        threading.Timer(0.05, long.silence).start()
        long.present(NOTHING)
        assert time.monotonic() - begin < 10


def test_texts_and_sounds_last_as_long_as_stated(tmp_path):
    soundfile.write(tmp_path / "tone.wav", np.zeros(800), 8000)
    shown = []
    show = lambda stimulus: shown.append((stimulus and stimulus.source, time.monotonic()))  # noqa: E731
    one = StimulusPresenter(tell=print, done=bool, show=show, folder=tmp_path)
    one.present(Stimulus(name="a", kind="text", source="rough", duration_s=0.2))
    one.present(Stimulus(name="b", kind="sound", source="tone.wav"))
    assert [source for source, _ in shown] == ["rough", None, "tone.wav", None]
    (began, text, sound, ended) = (at for _, at in shown)
    assert text - began >= 0.2
    assert ended - sound >= 0.1


def test_a_drive_for_another_array_is_refused_by_its_name_and_a_too_loud_one(tmp_path):
    save_drive(tmp_path / "a.drive.h5", frames=5, array=TransducerArray.autd3(columns=2, rows=1))
    with VirtualArray(ARRAY) as device, pytest.raises(InputError, match=r"a\.drive\.h5: drive: expected one for"):
        cleared_drives(tmp_path, Session.on(device, None, None))("a.drive.h5", 0.5)
    with Loud(ARRAY) as device:
        with pytest.raises(ExposureError, match=r"^exposure: .* dB too loud"):
            presenter(device, drive(), []).present(TONE)
        assert not device.emitting


@pytest.mark.long
@pytest.mark.clock
def test_the_failsafe_of_real_units_spoils_a_presentation_and_the_next_one_sounds():
    pytest.importorskip("autd3")
    from autd3 import Duration
    from autd3.commands import CpuConfig, SetCpuConfig

    def wait(milliseconds):
        banks = device.units
        order = SetCpuConfig(CpuConfig(failsafe_timeout=Duration.from_millis(milliseconds)))
        banks._repeatable(lambda: banks._open.send(order), 2)

    def trip():
        while not device.emitting:
            time.sleep(0.02)
        time.sleep(0.3)
        wait(1)  # Heartbeats come every 10 ms.
        time.sleep(0.1)
        wait(500)

    long = Drive(phase=np.zeros((1500, 249)), level=np.full(1500, 0.003), rate=1000.0, array=ARRAY)
    with autd3_array("emulator", Placement.grid(columns=1, rows=1)) as device:
        one = presenter(device, long, [])
        tripping = threading.Thread(target=trip)
        tripping.start()
        with pytest.raises(SilentFramesError, match=r"failsafe silenced unit 0: frames \d+ to 1499 of 1500"):
            one.present(TONE)
        tripping.join()
        one.present(TONE)


def test_a_presentation_with_silent_frames_does_not_count():
    class Stuttering(VirtualArray):
        def emit(self, drive, progress, **options):
            return replace(super().emit(drive, progress, **options), late=2, gap=0.25)

    with Stuttering(ARRAY) as device, pytest.raises(SilentFramesError, match=r"2 late frames and 0\.250 s of silence"):
        presenter(device, drive(), []).present(TONE)
