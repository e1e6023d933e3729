import pytest

from midair.errors import DeviceError, MidairError
from midair.studio.noise_process import NoiseProcess
from midair.study.design import MaskingNoise


def test_without_a_sound_output_nothing_is_presented_that_wants_noise():
    """A participant who hears the array is not blind."""
    noise = NoiseProcess()
    with pytest.raises(DeviceError, match="expected an open sound output"), noise.over(True):
        raise AssertionError("presented without noise")
    assert noise.take(None, "") == ""
    ran = []
    with noise.over(False):
        ran.append(True)
    assert ran == [True]


def test_an_output_that_is_not_there_is_said_before_the_session_begins():
    with pytest.raises(MidairError, match="headphones"):
        NoiseProcess().take(MaskingNoise(level_dbfs=-60), "no such output")
