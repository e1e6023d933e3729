import io

import numpy as np
import pytest
import soundfile
from tests.view.shown import focus, pressure, recording

from midair.errors import InputError
from midair.view import Channels, channel_sound, comparison_sounds, show_comparison, show_recording


def test_tone_keeps_its_frequency_and_peaks_near_full_scale():
    shown = show_recording(recording(500))
    heard = channel_sound(shown.samples, 6, shown.rate)
    sound, rate = soundfile.read(io.BytesIO(heard.data))
    assert (rate, sound.shape) == (48000, (24000,))
    assert np.abs(sound).max() == pytest.approx(0.9, abs=1e-3)
    assert np.abs(np.fft.rfft(sound)).argmax() * rate / len(sound) == pytest.approx(100, abs=2)
    assert heard.full_scale * 0.9 == pytest.approx(1, rel=0.02)


def test_silence_stays_silent_and_a_rest_makes_no_click():
    still = Channels(values=np.full((300, 2), 5.0), unit="V", label="rest")
    sound, _ = soundfile.read(io.BytesIO(channel_sound(still, 1, 1000).data))
    assert np.abs(sound).max() == 0


@pytest.mark.parametrize("channel", [-1, 16])
def test_missing_channel_is_refused(channel):
    with pytest.raises(InputError, match="expected 0 to 15"):
        channel_sound(show_recording(recording()).samples, channel, 1000)


def test_both_sounds_have_one_scale():
    (_, first), (name, second) = comparison_sounds(show_comparison(pressure(), pressure(scale=0.5)))
    loud, soft = (np.abs(soundfile.read(io.BytesIO(each.data))[0]).max() for each in (first, second))
    assert name == "re-recorded"
    assert (loud, soft / loud) == pytest.approx((0.9, 0.5), abs=1e-3)
    assert comparison_sounds(focus()) == ()
