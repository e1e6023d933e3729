from dataclasses import replace

import numpy as np
import pytest
from tests.view.shown import GRID, focus, focus_drive, focus_target, pressure, recording

from midair.errors import RateError
from midair.physics import propagate
from midair.view import show_comparison, show_recording, show_target
from midair.view.view_data import played_field


def test_a_recording_begins_with_its_loudest_channel_and_has_no_sound_as_a_target_has_no_samples():
    shown = show_recording(recording())
    assert (shown.title, shown.frames, shown.channel, shown.samples.unit) == ("tone", 60, 6, "V")
    assert shown.sound is None
    calibrated = show_recording(recording(), pressure=pressure(scale=3)).samples
    assert calibrated.unit == "Pa"
    assert calibrated.values.max() == pytest.approx(3, rel=0.05)
    target = show_target(focus_target())
    assert target.sound.played is None
    assert target.samples is None


def test_field_is_that_of_the_drive():
    drive = focus_drive(600)
    assert np.allclose(played_field(drive, GRID), propagate(drive, GRID))


def test_target_and_played_field_share_one_scale():
    shown = focus()
    assert shown.simulated, "the field is a model's"
    assert shown.sound.top == pytest.approx(max(3000, np.abs(shown.sound.played).max()))
    assert np.abs(shown.sound.played[0]).argmax() == 9 * 16 + 6


def test_a_comparison_is_as_long_as_both_and_of_one_rate():
    shown = show_comparison(pressure(60), pressure(50))
    assert (shown.frames, len(shown.samples.values), len(shown.again.values)) == (50, 50, 50)
    with pytest.raises(RateError, match="at one rate"):
        show_comparison(pressure(60), replace(pressure(60), rate=500))
