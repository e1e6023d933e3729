import numpy as np
import pytest

from midair.cli import run
from midair.files import load, load_calibration, load_pressure, save
from midair.model import Calibration, PressureFrames, Provenance, Recording


@pytest.fixture(autouse=True)
def take():
    samples = np.random.default_rng(0).normal(size=(500, 4, 4))
    samples[:100] *= 1e-3
    recording = Recording(samples=samples, rate=1000, provenance=Provenance(source="bench"))
    pressure = PressureFrames(pressure=samples / 0.02, rate=1000, sensor=recording.sensor)
    save(recording, "take.h5", calibration=Calibration.flat(recording.sensor, sensitivity=0.02), pressure=pressure)
    return recording


@pytest.mark.long
def test_cut_and_join_make_the_same_file_again(take, answer):
    told = answer("cut", "take.h5", "a.h5", "--end", "200ms")
    assert told["notes"] == ["The calibrated pressure was left out; run midair calibrate again."]
    assert run(["cut", "take.h5", "b.h5", "--start", "0.2s"]) == 0
    assert run(["join", "a.h5", "b.h5", "both.h5"]) == 0
    np.testing.assert_array_equal(load("both.h5").samples, take.samples)
    assert [step.stage for step in load("both.h5").provenance.steps] == ["join"]
    np.testing.assert_array_equal(load_calibration("both.h5").response, load_calibration("take.h5").response)
    assert load_pressure("both.h5") is None


@pytest.mark.long
def test_join_leaves_out_a_calibration_that_is_not_shared(take, answer):
    save(take, "other.h5", calibration=Calibration.flat(take.sensor, sensitivity=0.03))
    told = answer("join", "take.h5", "other.h5", "both.h5")
    assert "The calibration was left out: the recordings have different calibrations." in told["notes"]
    assert load_calibration("both.h5") is None


@pytest.mark.long
def test_each_command_does_its_edit_and_keeps_the_calibration(take):
    cells = take.samples.reshape(-1, 16)
    for number, (line, check) in enumerate(
        (
            ("resample --rate 2kHz", lambda made: made.rate == 2000 and made.frames == 1000),
            ("trim --margin 0s", lambda made: made.frames == 400),
            ("gain --by 2", lambda made: np.array_equal(made.samples, 2 * take.samples)),
            ("gain --by -20dB", lambda made: np.allclose(made.samples, take.samples / 10)),
            (
                "gain --by 3 --channels 1,2",
                lambda made: np.array_equal(made.samples[:, 0], take.samples[:, 0] * [1, 3, 3, 1]),
            ),
            ("fade --end 0s", lambda made: np.array_equal(made.samples[50:], take.samples[50:])),
            ("mask --channels 0,5", lambda made: (made.samples.reshape(-1, 16)[:, [0, 5]] == 0).all()),
            (
                "mask --channels 0 --fill neighbours",
                lambda made: np.allclose(made.samples[:, 0, 0], cells[:, [1, 4]].mean(axis=1)),
            ),
        )
    ):
        verb, *rest = line.split()
        name = f"made{number}.h5"
        assert run([verb, "take.h5", name, *rest]) == 0
        made = load(name)
        assert check(made), line
        assert made.provenance.steps[-1].stage == verb
        assert load_calibration(name) is not None, line


def test_the_result_can_be_of_any_format_or_the_file_itself_and_losses_are_printed(take, answer):
    told = answer("cut", "take.h5", "made.csv", "--end", "0.1s")
    assert [loss["what"] for loss in told["lost"]] == ["provenance", "calibration"]
    np.testing.assert_array_equal(load("made.csv").samples, take.samples[:100])
    assert run(["gain", "take.h5", "take.h5", "--by", "2", "--force"]) == 0
    np.testing.assert_array_equal(load("take.h5").samples, 2 * take.samples)
