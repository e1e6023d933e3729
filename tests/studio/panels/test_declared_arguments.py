import pytest
from pydantic import ValidationError

from midair.rig import PlaySettings, RecordSettings
from midair.studio.panels.play_panel import CheckExposure
from midair.studio.panels.record_panel import MakeTake


def test_defaults_are_those_of_the_settings():
    take, own = MakeTake(), RecordSettings()
    assert (take.duration_s, take.level, take.pre_roll_s, take.repeats) == (None, None, own.pre_roll, own.repeats)
    assert take.post_roll_s is None, "a take of the studio ends by its button"
    assert CheckExposure(take="a.h5").repeats == PlaySettings().repeats


@pytest.mark.parametrize(
    "wrong",
    [
        {"duration_s": 0},
        {"duration_s": 3601},
        {"level": 0},
        {"pre_roll_s": -0.1},
        {"pre_roll_s": 61},
        {"post_roll_s": 0},
        {"repeats": 0},
        {"repeats": 101},
    ],
)
def test_values_out_of_range_are_refused(wrong):
    with pytest.raises(ValidationError):
        MakeTake(**wrong)


@pytest.mark.parametrize("repeats", [0, 1001])
def test_repeats_of_a_drive_are_limited(repeats):
    with pytest.raises(ValidationError):
        CheckExposure(take="a.h5", repeats=repeats)
