import numpy as np
import pytest
import soundfile

from midair.errors import BrokenFileError, MismatchError, UnitError
from midair.files import load, open_take, save
from midair.model import Recording, SensorGrid


@pytest.fixture
def foreign(tmp_path):
    """A WAV of three frames and one channel at 8 kHz, in any subtype."""

    def write(subtype):
        soundfile.write(tmp_path / "a.wav", np.array([0.5, -0.25, 0.0]), 8000, subtype=subtype, format="WAV")
        return tmp_path / "a.wav"

    return write


def test_other_programs_read_midairs_own_below_full_scale(recording, tmp_path):
    lost = save(recording, tmp_path / "a.wav")
    samples, rate = soundfile.read(tmp_path / "a.wav", always_2d=True)
    assert rate == 333
    scale = 2.0 ** np.ceil(np.log2(np.abs(recording.samples).max()))
    np.testing.assert_array_equal(samples * scale, recording.samples.reshape(40, 15))
    assert 0.5 <= np.abs(samples).max() < 1
    assert "other programs read 333 Hz for 333.333333 Hz" in str(lost[1])
    assert f"stored from -1 to 1; multiply them by {scale:g} to get Pa" in str(lost[2])


@pytest.mark.parametrize("unit", ["Pa", "count"])
def test_a_flac_is_exact_within_its_bits(recording, unit, tmp_path):
    """Integers of a converter come back as they are, other samples within half a step; other programs read the same."""
    rng = np.random.default_rng(1)
    samples = rng.integers(-(2**15), 2**15, (500, 2, 4)) if unit == "count" else recording.samples[:, :2, :4]
    one = Recording(samples=samples, rate=1000 / 3, unit=unit, sensor=SensorGrid(rows=2))
    lost = save(one, tmp_path / "a.flac")
    heard, rate = soundfile.read(tmp_path / "a.flac", always_2d=True)
    assert rate == 333
    step = 2.0 ** (np.ceil(np.log2(np.abs(one.samples).max())) - 23)
    back = heard * step * 2**23
    assert np.abs(back - one.samples.reshape(back.shape)).max() <= (0 if unit == "count" else step / 2)
    assert f"rounded to 24 bits, steps of {step:.3g} {unit}" in str(lost)
    if unit == "Pa":
        taken = load(tmp_path / "a.flac", scale=step * 2**23, rate=one.rate, sensor=one.sensor)
        np.testing.assert_array_equal(taken.samples.reshape(back.shape), back)


def test_every_subtype_is_read_to_full_scale_one_and_to_counts(foreign, subtests):
    for subtype, full in [("PCM_U8", 2**7), ("PCM_16", 2**15), ("PCM_24", 2**23), ("PCM_32", 2**31), ("DOUBLE", 1)]:
        with subtests.test(subtype=subtype):
            seen = open_take(foreign(subtype), unit="V")
            np.testing.assert_array_equal(seen.recording.samples.ravel(), [0.5, -0.25, 0])
            assert seen.recording.rate == 8000
            assert seen.recording.sensor.shape == (1, 1)
            assert seen.report == (f"Full scale of the WAV ({subtype}) was taken as 1 V.",)
            np.testing.assert_array_equal(
                load(foreign(subtype), unit="count").samples.ravel(), np.array([0.5, -0.25, 0]) * full
            )


def test_reads_mu_law_by_its_table(foreign):
    """ITU-T G.711: (132 + 8 m) 2^e - 132 of 32768, with sign, e and m in the inverted bits of a byte.

    0x80 is + 7 15: 252 * 128 - 132 = 32124; 0xBF is + 4 0: 132 * 16 - 132 = 1980; 0x00 is - 7 15.
    """
    path = foreign("ULAW")
    data = path.read_bytes()
    place = data.index(b"data") + 8
    path.write_bytes(data[:place] + b"\x80\xbf\x00" + data[place + 3 :])
    np.testing.assert_allclose(load(path, unit="V").samples.ravel() * 32768, [32124, 1980, -32124])
    with pytest.raises(UnitError, match="µ-law holds no counts"):
        load(path, unit="count")


def test_takes_the_exact_rate_behind_a_whole_one_and_refuses_other_subtypes(foreign):
    assert load(foreign("FLOAT"), unit="V", rate=7999.7).rate == 7999.7
    with pytest.raises(MismatchError, match="the file states 8000 Hz, got 1000 Hz"):
        load(foreign("FLOAT"), unit="V", rate=1000)
    with pytest.raises(BrokenFileError, match="got WAV with ALAW"):
        load(foreign("ALAW"), unit="V")
    seen = open_take(foreign("PCM_16"), scale=30.0)
    np.testing.assert_array_equal(seen.recording.samples.ravel(), [15, -7.5, 0])
    assert seen.recording.unit == "Pa"
    assert seen.report == ("Full scale of the WAV (PCM_16) was taken as 30 Pa.",)
    assert seen.recording.provenance.steps[0].settings["scale_pa"] == 30


@pytest.mark.parametrize("size", [0xFFFFFFFF, 0x80000000, 0x7FFFFFFF - 36, 0])
@pytest.mark.parametrize("start", [0.0, 0.3])
def test_samples_of_no_stated_length_are_read_to_the_end(size, start, tmp_path):
    """Sizes of ffmpeg, arecord and SoX that write to a pipe, and of a recorder that was cut off."""
    wave = np.r_[[start] * 10, tone()].astype(np.float32)
    soundfile.write(tmp_path / "a.wav", wave, 8000, subtype="FLOAT", format="WAV")
    data = bytearray((tmp_path / "a.wav").read_bytes())
    at = data.index(b"data") + 4
    data[at : at + 4] = size.to_bytes(4, "little")
    (tmp_path / "a.wav").write_bytes(data[: at + 4 + 4 * len(wave)])
    taken = open_take(tmp_path / "a.wav", unit="V")
    np.testing.assert_array_equal(taken.recording.samples.ravel(), wave)
    assert taken.report[-1] == "The length of the samples was not stated: the file was read to its end."


@pytest.mark.parametrize(
    ("form", "ending", "subtype", "channels"),
    [("RF64", ".rf64", "DOUBLE", 16), ("RF64", ".wav", "PCM_24", 1), ("WAVEX", ".wav", "PCM_16", 3)],
)
def test_reads_the_forms_for_long_files_and_refuses_cut_ones(form, ending, subtype, channels, tmp_path):
    samples = np.random.default_rng(0).integers(-100, 100, (20, channels)) / 128
    soundfile.write(tmp_path / f"a{ending}", samples, 4000, subtype=subtype, format=form)
    sensor = SensorGrid(rows=1, columns=channels)
    seen = open_take(tmp_path / f"a{ending}", unit="V", sensor=sensor)
    np.testing.assert_array_equal(seen.recording.samples.reshape(20, channels), samples)
    assert seen.recording.rate == 4000
    data = (tmp_path / f"a{ending}").read_bytes()
    for kept in (0.1, 0.5, 0.95) if form == "RF64" else ():
        (tmp_path / f"b{ending}").write_bytes(data[: int(kept * len(data))])
        with pytest.raises(BrokenFileError):
            load(tmp_path / f"b{ending}", unit="V", sensor=sensor)


def tone(seconds=0.5, rate=8000):
    return 0.5 * np.sin(2 * np.pi * 150 * np.arange(int(seconds * rate)) / rate)


def test_damage_and_loss_are_named(tmp_path):
    for name, subtype in (("a.ogg", "VORBIS"), ("a.mp3", "MPEG_LAYER_III")):
        soundfile.write(tmp_path / name, tone(1.0), 8000, subtype=subtype)
        assert "lossy" in " ".join(open_take(tmp_path / name, unit="V").report)
    soundfile.write(tmp_path / "a.flac", tone(2.0), 8000)
    whole = (tmp_path / "a.flac").read_bytes()
    (tmp_path / "b.flac").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(BrokenFileError):
        open_take(tmp_path / "b.flac", unit="V")
    soundfile.write(tmp_path / "c.wav", tone(), 8000)
    (tmp_path / "c.wav").rename(tmp_path / "c.flac")
    with pytest.raises(BrokenFileError, match="WAV"):
        open_take(tmp_path / "c.flac", unit="V")
