"""Live touch from another program's stream over LSL, on loopback, to emulated units."""

from pathlib import Path

import numpy as np
import pytest
from tests.rig.live_touch.test_session import skin as sent
from tests.waiting import wait_until

import midair
from midair.devices import ExposureChoices
from midair.errors import DeviceError
from midair.files import DEFAULT_PROFILE, load_played, open_take, profile_named

pytestmark = pytest.mark.slow

ANSWERED = ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override="a test")


@pytest.fixture
def skin(monkeypatch):
    pytest.importorskip("pylsl")
    monkeypatch.setenv("LSLAPICFG", str(Path(__file__).parents[2] / "devices" / "sensors" / "lsl_api.cfg"))
    with sent(1000) as made:
        yield made


def test_all_frames_of_another_program_arrive_and_lost_ones_are_counted(skin, tmp_path):
    path = tmp_path / "felt.h5"
    with midair.live(skin[0], "autd3:emulator", exposure=ANSWERED, duration=5.0, keep=path) as session:
        session.wait()
    told, felt, played = session.statistics, open_take(path).recording.samples[:, 1, 1], load_played(path)
    assert told.frames == len(felt) == played.frames
    assert told.lost == pytest.approx(100, abs=20)
    # In step with the tone from the first frame to the last but for the frames left out, whose place holds.
    sent = 20.0 * np.sin(0.2 * np.pi * (np.arange(len(felt)) + np.arange(10)[:, None]))
    held = (np.abs(felt - sent) > 1e-3).sum(axis=1).min()
    assert held <= told.lost
    assert ((played.state & 1) > 0).sum() > 1000


def test_a_program_that_ends_is_a_sensor_that_is_lost(skin):
    sensor, running = skin
    with pytest.raises(DeviceError, match="lsl"), midair.live(sensor, "autd3:emulator", exposure=ANSWERED) as session:
        session.wait(1.0)
        running.kill()
        wait_until(lambda: not session.wait(0.1), 10)
