"""Real recordings by others, if a copy is beside the repository; skipped elsewhere."""

from pathlib import Path

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import open_take

DATA = Path(__file__).parents[3] / "shared" / "data"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason="needs the folder of real recordings beside the repository"),
]


def files(folder, ending):
    return sorted((DATA / folder).rglob(f"*{ending}"))


def test_every_file_is_tested():
    found = {path.relative_to(DATA).parts[0] for ending in ("csv", "wav") for path in DATA.rglob(f"*.{ending}")}
    # Poses of palms are no recordings; the fits of palms read them.
    assert found <= {"fabricslide", "hapmat", "audio-to-tactile", "anova", "palm-poses"}


def test_fabricslide():
    paths = files("fabricslide", ".csv")
    assert len(paths) > 40
    for path in paths:
        recording = open_take(path).recording
        assert recording.sensor.shape == (4, 4)
        assert recording.unit == "count"
        assert 35.4 < recording.rate < 35.8
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        # Cubic splines between the rows may pass the highest one, by less than the step of the converter.
        assert recording.samples.min() > rows[:, 3:].min() - 1
        assert recording.samples.max() < rows[:, 3:].max() + 1
        np.testing.assert_array_equal(recording.samples[0].ravel(), rows[0, 3:])


def test_hapmat():
    paths = files("hapmat", ".csv")
    assert len(paths) == 3
    for path in paths:
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        for number, name in enumerate(("accel_x", "accel_y", "accel_z"), start=1):
            seen = open_take(path, channels=[name], scale=2.0)
            np.testing.assert_allclose(seen.recording.samples.ravel(), 2 * rows[:, number], atol=1e-9)
            assert (seen.recording.rate, seen.recording.unit) == (100, "Pa")
            repeats = int((np.diff(rows[:, number]) == 0).sum())
            told = [sentence for sentence in seen.report if f"{repeats} of 6001 rows repeat" in sentence]
            assert len(told) == (repeats > 0)


def test_audio_to_tactile():
    for path in files("audio-to-tactile", ".wav"):
        if path.name == "wav_bad_fact.wav":
            with pytest.raises(BrokenFileError, match="expected samples, got a file that ends in chunk 'fact'"):
                open_take(path, unit="V")
            continue
        recording = open_take(path, unit="V", channels=["0"]).recording
        assert np.abs(recording.samples).max() <= 1
        if path.name.startswith("tactile"):
            assert (recording.rate, recording.frames) == (1953, 1953)
    exact = {"wav_float64.wav": [1, 0, -1, 0.3], "wav_float32.wav": [1000 / 32768, -2000 / 32768, 32767 / 32768, -1]}
    for name, values in exact.items():
        np.testing.assert_allclose(
            open_take(DATA / "audio-to-tactile" / name, unit="V").recording.samples.ravel(), values
        )
    counts = open_take(DATA / "audio-to-tactile" / "wav_int24.wav", unit="count").recording.samples.ravel()
    np.testing.assert_array_equal(counts, [0x700, -0x200, 0x7FFF00, -0x800000])
