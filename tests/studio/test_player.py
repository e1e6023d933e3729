import pytest

from midair.errors import DeviceError, MidairError
from midair.studio.player import NoiseOutput
from midair.study.design import MaskingNoise


def test_stimulus_with_noise_needs_a_sound_output():
    """A participant who hears the array is not blinded."""
    noise = NoiseOutput()
    with pytest.raises(DeviceError, match="expected an open sound output"), noise.over(True):
        raise AssertionError("presented without noise")
    assert noise.take(None, "") == ""
    ran = []
    with noise.over(False):
        ran.append(True)
    assert ran == [True]


def test_missing_sound_output_is_reported_before_the_session():
    with pytest.raises(MidairError, match="headphones"):
        NoiseOutput().take(MaskingNoise(level_dbfs=-60), "no such output")
