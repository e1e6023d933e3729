"""Record, play and loop from Python on devices by name."""

import numpy as np
import pytest

import midair
from midair.devices import ExposureChoices, VirtualArray
from midair.errors import DeviceStateError, ExposureError, InputError, MismatchError, UnknownDeviceError
from midair.files import profile_named
from midair.model import AmplitudeFrames, ControlGrid, Medium, Recording, TransducerArray
from midair.physics import focus_amplitude
from midair.rig import OpenRig, default_exposure, open_rig, play, record
from midair.settings import Settings

COARSE = ControlGrid(rows=6, columns=6, pitch=11e-3)
QUICK = Settings().but(grid=COARSE, method="fast")
ARRAY = TransducerArray.autd3()


class Loud(VirtualArray):
    """A virtual array that passes for one that can be heard."""

    simulated, gated = False, True


@pytest.fixture(scope="module")
def solution():
    amplitude = np.zeros((60, 36))
    amplitude[:, 14] = 0.1 * focus_amplitude(COARSE, ARRAY)
    return midair.solve(AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=COARSE), ARRAY, method="fast")


def test_a_recording_has_its_calibration(tmp_path):
    take = record("virtual:am-i", 0.1, notes={"object": "tone"})
    assert take.recording.frames == 100
    assert take.calibration is not None
    assert take.recording.provenance.simulated
    kept = record("virtual:am-i", 0.1, notes={"object": "tone"}, path=tmp_path / "take.h5")
    np.testing.assert_array_equal(kept.recording.samples, take.recording.samples)
    assert kept.calibration is not None
    assert kept.recording.provenance.notes["object"] == "tone"
    again = record(f"replay:{tmp_path / 'take.h5'}", 0.05)
    np.testing.assert_array_equal(again.recording.samples, take.recording.samples[:50])
    assert again.calibration is not None


def test_an_open_sensor_can_be_recorded_twice():
    with open_rig() as rig:
        one, two = record(rig.sensor, 0.02), record(rig.sensor, 0.02)
    assert one.recording.frames == two.recording.frames == 20


def test_a_solution_is_played_and_rerecorded_on_a_virtual_rig(solution):
    played = play(solution)
    assert played.outcome == "exceeded"
    assert played.take.recording.frames == 80
    pressure = midair.calibrate(played.take.recording, played.take.calibration)
    assert np.abs(pressure.pressure).max() > 1
    assert "heard: " in repr(played)
    assert len(repr(played)) < 600


def test_a_drive_is_played_on_a_rig_that_is_open_as_often_as_asked(solution):
    with open_rig(seed=1) as rig:
        assert play(solution.drive, rig, repeats=3).take.recording.frames == 200
        assert not rig.array.emitting


def test_the_virtual_rig_can_have_other_air_than_the_drive(solution):
    here = play(solution).take.recording.samples
    with open_rig(acoustics=midair.Acoustics(medium=Medium.at(temperature=24.0))) as warm:
        there = play(solution, warm).take.recording.samples
    assert not np.allclose(here, there)


def test_a_rig_that_was_not_entered_does_not_play(solution):
    with pytest.raises(DeviceStateError, match="open"):
        play(solution, open_rig())


def test_nothing_is_louder_than_the_rig_allows(solution):
    rig = OpenRig(array=Loud(ARRAY), sensor=None, exposure=default_exposure())
    with rig:
        with pytest.raises(ExposureError, match="limit 110 dB"):
            play(solution, rig)
        assert not rig.array.emitting
        weaker = ExposureChoices(profile=profile_named("occupational-110"), attenuate=True)
        played = play(solution, rig, exposure=weaker)
    assert played.outcome == "attenuated"
    assert played.report.frames == 60
    assert played.take is None
    assert "nothing listened" in repr(played)


def test_a_drive_for_another_array_is_refused(solution):
    one = OpenRig(
        array=VirtualArray(TransducerArray.autd3(columns=1, rows=1)), sensor=None, exposure=default_exposure()
    )
    with one, pytest.raises(MismatchError, match="solve the target again"):
        play(solution, one)


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: open_rig("autd9"), UnknownDeviceError, "expected virtual, autd3"),
        (lambda: open_rig("virtual", "lsl:Skin"), InputError, "since it has its own"),
        (lambda: record("virtual:cat"), UnknownDeviceError, "expected brush, sponge or towel"),
        (lambda: record("virtual:towel", 0.0), InputError, "at least one frame"),
    ],
)
def test_unknown_names_are_refused(make, error, says):
    with pytest.raises(error, match=says):
        make()


@pytest.mark.slow
def test_the_loop_accepts_a_take_a_file_or_a_pressure(tmp_path):
    take = record("virtual:am-i", 0.1, path=tmp_path / "take.h5")
    pressure = midair.pipeline.calibrated_pressure(take.recording, take.calibration, QUICK).cut(0.02, 0.04)
    done = midair.loop(pressure, QUICK)
    assert len(done.passes) == 2
    assert done.passes[-1].comparison.correlation > 0.5
    from_file = midair.loop(tmp_path / "take.h5", QUICK, corrections=0)
    from_take = midair.loop(take, QUICK, corrections=0)
    assert from_file.passes[0].gain == from_take.passes[0].gain
    np.testing.assert_array_equal(from_file.original.pressure, from_take.original.pressure)


def test_a_loop_needs_a_sensor():
    pressure = midair.PressureFrames(pressure=np.ones((10, 4, 4)), rate=1000.0)
    deaf = OpenRig(array=Loud(ARRAY), sensor=None, exposure=default_exposure())
    with deaf, pytest.raises(InputError, match="expected a rig with a sensor"):
        midair.loop(pressure, QUICK, deaf)


def test_a_loaded_take_equals_the_recording(tmp_path):
    record("virtual:am-i", 0.05, path=tmp_path / "take.h5")
    assert isinstance(midair.load(tmp_path / "take.h5"), Recording)
    assert "OpenRig virtual" in repr(open_rig())
