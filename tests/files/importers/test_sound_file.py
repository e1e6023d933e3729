"""Sound files of other programs, written by libsndfile."""

import numpy as np
import pytest
import soundfile

from midair.errors import BrokenFileError, UnitError
from midair.files import open_take

LOSSLESS = [("a.flac", "FLAC", "PCM_24"), ("a.aiff", "AIFF", "PCM_16"), ("a.aif", "AIFF", "PCM_24")]
LOSSY = [("a.ogg", "VORBIS"), ("a.mp3", "MPEG_LAYER_III")]


def tone(seconds=0.5, rate=8000):
    return 0.5 * np.sin(2 * np.pi * 150 * np.arange(int(seconds * rate)) / rate)


@pytest.mark.parametrize(("name", "form", "subtype"), LOSSLESS)
def test_lossless_samples_are_a_part_of_full_scale(tmp_path, name, form, subtype):
    soundfile.write(tmp_path / name, np.stack([tone(), -tone()], axis=1), 8000, subtype=subtype, format=form)
    taken = open_take(tmp_path / name, scale=30.0, channels=("0",))
    assert taken.recording.rate == 8000
    np.testing.assert_allclose(taken.recording.samples[:, 0, 0], 30 * tone(), atol=30 * 2.0**-15)
    assert "was taken as 30 Pa" in " ".join(taken.report)


@pytest.mark.parametrize(("name", "subtype"), LOSSY)
def test_lossy_samples_are_close_and_reported(tmp_path, name, subtype):
    soundfile.write(tmp_path / name, tone(1.0), 8000, subtype=subtype)
    taken = open_take(tmp_path / name, unit="V")
    heard = taken.recording.samples[2000:6000, 0, 0]
    assert np.abs(np.fft.rfft(heard)).argmax() == 75
    assert heard.std() == pytest.approx(tone(1.0).std(), rel=0.05)
    assert "lossy" in " ".join(taken.report)


def test_counts_are_the_whole_numbers_of_pcm(tmp_path):
    soundfile.write(tmp_path / "a.flac", tone(), 8000, subtype="PCM_16")
    found = open_take(tmp_path / "a.flac", unit="count").recording.samples
    np.testing.assert_array_equal(found, np.round(found))
    assert np.abs(found).max() == pytest.approx(2**14, rel=1e-3)


def test_missing_facts_and_damage_are_named(tmp_path):
    soundfile.write(tmp_path / "a.flac", tone(2.0), 8000)
    with pytest.raises(UnitError, match="unit"):
        open_take(tmp_path / "a.flac")
    whole = (tmp_path / "a.flac").read_bytes()
    (tmp_path / "b.flac").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(BrokenFileError):
        open_take(tmp_path / "b.flac", unit="V")
    soundfile.write(tmp_path / "c.wav", tone(), 8000)
    (tmp_path / "c.wav").rename(tmp_path / "c.flac")
    with pytest.raises(BrokenFileError, match="WAV"):
        open_take(tmp_path / "c.flac", unit="V")
