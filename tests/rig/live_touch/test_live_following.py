"""Live frames that follow a palm."""

import numpy as np
import pytest
from tests.palms import palm_path

import midair
from midair.files import load_played, save_palm_path
from midair.model import Acoustics, TransducerArray
from midair.physics import middle_of, steering_phase
from midair.rig import LiveSettings, open_tracker
from midair.rig.live_touch.live_loop import LiveSteering

ARRAY, AIR, SOLVED = TransducerArray.autd3(columns=1, rows=1), Acoustics(), middle_of(LiveSettings().grid)


def test_frames_get_the_phases_of_the_palm_and_fade_when_it_is_gone(tmp_path) -> None:
    hand = palm_path(np.arange(20) / 100, np.tile(SOLVED + np.array([6e-3, -4e-3, 3e-3]), (20, 1)))
    save_palm_path(hand, tmp_path / "hand.csv")
    now, lines = [0.0], []
    with open_tracker(f"replay:{tmp_path / 'hand.csv'}", clock=lambda: now[0]) as tracker:
        tracker.begin(0.0)
        steering = LiveSteering(tracker, ARRAY, 1000.0, LiveSettings(acoustics=AIR), lines.append)
        solved, gains, sent = np.arange(249).astype(np.uint8), [], []
        for number in range(400):
            # Late frames, which are left out, shift nothing.
            if number % 37:
                now[0] = number / 1000
                gains.append(steering.steer(solved, now[0] + 0.006))
                sent.append(steering.phases.copy())
    exact = steering_phase(ARRAY, AIR.medium, SOLVED, hand, aim=SOLVED)[0] * 128 / np.pi
    np.testing.assert_array_equal(sent[100], solved + np.rint(exact).astype(np.int64).astype(np.uint8))
    assert gains[:1] < [0.2]
    assert gains[20:250] == [1.0] * 230
    assert gains[320:] == [0.0] * len(gains[320:])
    assert [line.partition(",")[0] for line in lines] == ["follow: the palm is followed", "follow: no pose for 100 ms"]


@pytest.mark.long
def test_live_touch_is_heard_while_the_palm_is_there_and_its_take_has_the_steered_phases(tmp_path) -> None:
    save_palm_path(palm_path(np.arange(100) / 100, np.tile(SOLVED, (100, 1))), tmp_path / "hand.csv")
    lines, kept = [], tmp_path / "felt.h5"
    with midair.live(
        "virtual:towel", follow=f"replay:{tmp_path / 'hand.csv'}", duration=1.6, keep=kept, report=lines.append
    ) as session:
        session.wait()
    loud = load_played(kept).intensity > 0
    assert loud[700:1000].mean() > 0.8
    assert not loud[1250:].any()
    assert [line.partition(",")[0] for line in lines] == ["follow: the palm is followed", "follow: no pose for 100 ms"]
