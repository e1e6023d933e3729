import numpy as np
import pytest

from midair.devices.arrays.silencer import choose_silencer, typical_step
from midair.errors import InputError

ON = np.full(20, 255, np.uint8)


def steps(degrees, frames=20):
    """Every transducer steps back and forth by the same angle."""
    phase = np.zeros((frames, 2, 249), np.uint8)
    phase[1::2] = round(degrees * 256 / 360)
    return phase


@pytest.mark.parametrize("degrees", [0, 45, 90, 180, 350])
def test_steps_go_the_short_way_round(degrees):
    assert typical_step(steps(degrees), ON) == pytest.approx(min(degrees, 360 - degrees), abs=0.8)


def test_steps_of_silent_frames_do_not_count():
    level = ON.copy()
    level[1::2] = 0
    assert typical_step(steps(180), level) == 0
    assert typical_step(steps(180, frames=1), ON[:1]) == 0


@pytest.mark.parametrize(("degrees", "phase"), [(20, 0), (44, 0), (60, 0.25e-3), (120, 0.5e-3)])
def test_auto_spreads_what_would_be_heard(degrees, phase):
    chosen = choose_silencer("auto", steps(degrees), ON, 1000.0)
    assert chosen.phase == pytest.approx(phase)
    assert f"below {typical_step(steps(degrees), ON):.0f} deg" in str(chosen)


@pytest.mark.parametrize("rate", [100.0, 1000.0, 4000.0, 40e3])
def test_a_step_is_complete_within_half_a_frame_or_in_the_shortest_time_there_is(rate):
    chosen = choose_silencer("auto", steps(180), ON, rate)
    assert 25e-6 <= chosen.phase <= max(25e-6, 0.5 / rate)
    assert chosen.phase <= 1e-3
    assert chosen.phase / 25e-6 == pytest.approx(round(chosen.phase / 25e-6))


def test_choices_by_name():
    assert choose_silencer("off", steps(180), ON, 1000.0).phase == 0
    assert choose_silencer("default", steps(0), ON, 1000.0).phase == 1e-3
    with pytest.raises(InputError, match="auto, off"):
        choose_silencer("loud", steps(0), ON, 1000.0)
