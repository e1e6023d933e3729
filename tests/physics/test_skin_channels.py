import numpy as np
import pytest

from midair.physics import TOUCH_CHANNELS


def test_each_channel_is_whole_where_it_feels_best():
    assert TOUCH_CHANNELS["P"].weight(np.array([250.0])) == pytest.approx([1.0])
    assert TOUCH_CHANNELS["NP I"].weight(np.array([10.0, 25.0, 40.0])) == pytest.approx([1.0, 1.0, 1.0])


def test_an_octave_away_pacinian_corpuscles_take_up_a_quarter_below_and_a_third_above():
    # 12 dB and 9 dB.
    assert TOUCH_CHANNELS["P"].weight(np.array([125.0, 500.0])) == pytest.approx([0.2512, 0.3548], abs=1e-4)


def test_static_displacement_has_no_weight():
    assert [channel.weight(np.zeros(1))[0] for channel in TOUCH_CHANNELS.values()] == [0.0, 0.0]
