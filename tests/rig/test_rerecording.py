"""Re-recording on rigs that are not virtual: gating, latency, lost frames."""

from dataclasses import replace

import numpy as np
import pytest

from midair.datasets import probe_signal
from midair.devices import ExposureChoices, check_exposure, state_folder
from midair.devices.interface import FrameBlock
from midair.errors import DeviceError
from midair.files import profile_named
from midair.model import ControlGrid, TransducerArray
from midair.pipeline import reproduce
from midair.rig import Cleared, OpenRig, PlaySettings, Session, VirtualRig
from midair.rig.correction.iteration import no_progress, play_pass
from midair.settings import Settings

RIG = VirtualRig(array=TransducerArray.autd3(columns=1, rows=1))
SETTINGS = Settings().but(grid=ControlGrid(rows=6, columns=6, pitch=11e-3), method="fast")
PROFILE = profile_named("occupational-110")
ANSWERED = ExposureChoices(profile=PROFILE, override="A. Person")


def original():
    touch = probe_signal("25+250 Hz", duration=0.08, rest=0.02, rate=1000.0)
    return replace(touch, provenance=replace(touch.provenance, simulated=False))


@pytest.fixture(scope="module")
def drive():
    return reproduce(original(), RIG.array, SETTINGS).solution.drive


def real(latency=0.0, lost=None):
    """A virtual rig that passes for a real one: it must be gated, and its sensor runs before the array begins."""
    skin = RIG.skin()
    array, sensor = RIG.array_device(skin), RIG.sensor(skin)
    array.simulated, array.gated, sensor.simulated = False, True, False
    emit, read = array.emit, sensor.read

    def late(drive, progress, **others):
        skin.press(np.zeros((round(latency * skin.rate), skin.points.count)))
        return emit(drive, progress, **others)

    def in_blocks(frames):
        block = read(min(frames, 40))
        return (
            block
            if lost is None or block.first < lost
            else FrameBlock(samples=block.samples, first=block.first + 1, device_time=0, host_time=0, overflow=True)
        )

    array.emit, sensor.read = late, in_blocks
    return array, sensor


def rerecord(clearance, array, sensor, tail=0.02):
    session = Session.on(array, sensor, None)
    cleared = Cleared(drive=clearance.drive, clearance=clearance, settings=session.rig.settings)
    return session.play(cleared, source="test", tail=tail).take.recording


@pytest.mark.long
def test_an_override_is_played_and_logged(drive):
    array, sensor = real()
    with array, sensor:
        heard = rerecord(check_exposure(drive, array, ANSWERED), array, sensor, tail=0.2)
    assert heard.frames >= drive.frames
    assert not heard.provenance.simulated
    log = "".join(path.read_text(encoding="utf-8") for path in state_folder().glob("*.jsonl"))
    assert "A. Person" in log
    assert "played" in log


@pytest.mark.long
def test_the_drive_is_found_in_what_a_real_sensor_heard(drive):
    array, sensor = real(latency=0.07)
    with array, sensor:
        rig = OpenRig(array=array, sensor=sensor, settings=PlaySettings(exposure=ANSWERED))
        heard = rerecord(check_exposure(drive, array, rig.exposure), array, sensor, tail=0.3)
        late = np.argmax(np.abs(heard.samples).max(axis=(1, 2)) > 0.01)
        assert late >= 60
        rig_pass = play_pass_with_tail(rig)
    assert rig_pass.comparison.correlation > 0.65
    assert abs(rig_pass.comparison.delay) < 5e-3


def play_pass_with_tail(rig, tail=0.3):
    kept = Session.rerecord
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Session, "rerecord", lambda *arguments, **others: kept(*arguments, tail=tail, **others))
        return play_pass(original(), original(), rig, SETTINGS, "pass", no_progress)


@pytest.mark.long
def test_a_rerecording_states_how_loud_its_drive_is_for_unprotected_ears(drive):
    skin, found = RIG.skin(), []
    for profile in (PROFILE, PROFILE.behind(20)):
        with RIG.array_device(skin) as array, RIG.sensor(skin) as sensor:
            clearance = check_exposure(drive, array, ExposureChoices(profile=profile))
            found.append(rerecord(clearance, array, sensor).provenance.last("play")["ears_excess_db"])
    assert found[0] == pytest.approx(found[1], abs=0.02)
    assert found[1] == pytest.approx(clearance.exposure.sound_excess + 20, abs=0.02)


@pytest.mark.long
def test_lost_frames_are_an_error(drive):
    array, sensor = real(lost=80)
    with array, sensor, pytest.raises(DeviceError, match="lost frames"):
        rerecord(check_exposure(drive, array, ANSWERED), array, sensor, tail=0.2)
