import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.calibration import StreamingInverse, calibrate
from midair.errors import BandError, InputError, NonFiniteError, ShapeError
from midair.model import Calibration, Recording, SensorGrid
from midair.physics import SensorModel, calibration_of, sense

MIXED = np.eye(16) + 0.05 * (np.abs(np.subtract.outer(np.arange(16), np.arange(16))) == 1)
CALIBRATION = calibration_of(SensorModel(crosstalk=MIXED).with_spread(seed=7))


def recorded(frames=900, seed=0):
    pressure = 10 * np.random.default_rng(seed).standard_normal((frames, 4, 4))
    volts = sense(SensorModel(crosstalk=MIXED).with_spread(seed=7), pressure, 1000.0)
    return Recording(samples=volts, rate=1000.0)


def streamed(stream, samples, cuts):
    blocks = np.split(samples, sorted(cuts))
    return np.concatenate([*(stream.push(block) for block in blocks), stream.finish()])


@settings(max_examples=8)
@given(st.lists(st.integers(0, 900), max_size=6), st.sampled_from([201, 401, 3]))
def test_blocks_equal_the_whole_recording(cuts, taps):
    recording = recorded()
    whole = calibrate(recording, CALIBRATION, method="fir", taps=taps).pressure
    stream = StreamingInverse(CALIBRATION, 1000.0, taps=taps)
    assert streamed(stream, recording.samples, cuts) == pytest.approx(whole, abs=1e-9 * np.abs(whole).max())


@pytest.mark.parametrize("frames", [60, 90, 250])
def test_a_short_stream_comes_out_whole(frames):
    recording = recorded(frames)
    whole = calibrate(recording, CALIBRATION, method="fir", crosstalk="undo").pressure
    stream = StreamingInverse(CALIBRATION, 1000.0, crosstalk="undo")
    assert streamed(stream, recording.samples, range(0, frames, 7)) == pytest.approx(whole, abs=1e-7)


def test_agrees_with_the_offline_inverse_to_the_stated_tolerance():
    """Noise with silent ends: .4 % rms with the default taps, .06 % with 401."""
    rest = np.sin(np.pi * np.clip(np.minimum(np.arange(4000), np.arange(4000)[::-1]) / 300, 0, 0.5)) ** 2
    pressure = 10 * np.random.default_rng(1).standard_normal((4000, 4, 4)) * rest[:, None, None]
    recording = Recording(samples=sense(SensorModel().with_spread(seed=7), pressure, 1000.0), rate=1000.0)
    known = calibration_of(SensorModel().with_spread(seed=7))
    offline = calibrate(recording, known).pressure
    for taps, tolerance in ((None, 6e-3), (401, 1e-3)):
        live = streamed(StreamingInverse(known, 1000.0, taps=taps), recording.samples, range(0, 4000, 50))
        assert np.sqrt(np.mean((live - offline) ** 2) / np.mean(offline**2)) < tolerance


def test_frames_come_out_after_the_delay():
    stream = StreamingInverse(CALIBRATION, 1000.0)
    assert stream.delay == 0.1
    samples = recorded().samples
    out = [len(stream.push(samples[i : i + 10])) for i in range(0, 300, 10)]
    assert out == [0] * 10 + [10] * 20
    assert len(stream.finish()) == 100


def test_a_new_stream_begins_after_the_end():
    stream = StreamingInverse(CALIBRATION, 1000.0)
    first = streamed(stream, recorded(seed=0).samples, [400])
    streamed(stream, recorded(seed=1).samples, [10])
    assert (streamed(stream, recorded(seed=0).samples, [400]) == first).all()
    assert stream.finish().shape == (0, 4, 4)


def test_crosstalk_is_undone():
    recording = recorded()
    pressure = 10 * np.random.default_rng(0).standard_normal((900, 4, 4))
    plain = calibrate(recording, CALIBRATION).pressure
    undone = calibrate(recording, CALIBRATION, crosstalk="undo")
    wanted = calibrate(Recording(samples=pressure, rate=1000.0, unit="Pa")).pressure
    middle = slice(200, 700)
    error = [np.sqrt(np.mean((one[middle] - wanted[middle]) ** 2)) for one in (plain, undone.pressure)]
    assert error[1] < 0.05 * error[0]
    assert undone.provenance.steps[-1].settings["crosstalk"] == "undone with a damping of 0"


def test_bad_input_is_refused():
    stream = StreamingInverse(CALIBRATION, 1000.0)
    with pytest.raises(ShapeError, match=r"\(frame, 4, 4\), got \(3, 2, 2\)"):
        stream.push(np.ones((3, 2, 2)))
    with pytest.raises(NonFiniteError):
        stream.push(np.full((3, 4, 4), np.nan))
    assert stream.push(np.zeros((0, 4, 4))).shape == (0, 4, 4)
    flat = Calibration.flat(SensorGrid())
    with pytest.raises(InputError, match="press on each cell"):
        StreamingInverse(flat, 1000.0, crosstalk="undo")
    with pytest.raises(InputError, match="keep or undo, got 'maybe'"):
        StreamingInverse(flat, 1000.0, crosstalk="maybe")
    narrow = Calibration(
        sensor=SensorGrid(), frequency=np.array([50.0, 100.0]), response=np.ones((2, 4, 4)), noise=np.zeros((4, 4))
    )
    with pytest.raises(BandError, match="calibration's 50 to 100 Hz"):
        StreamingInverse(narrow, 1000.0)
