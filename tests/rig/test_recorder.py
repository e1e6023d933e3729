from dataclasses import replace

import numpy as np
import pytest
from tests.drives import Loud
from tests.model.test_calibration import calibration

import midair
from midair.devices import ExposureChoices, FrameBlock, ReplaySensor
from midair.errors import DeviceError, DeviceStateError, ExposureError, InputError
from midair.files import load, profile_named
from midair.model import AmplitudeFrames, ControlGrid, Medium, Recording, TransducerArray
from midair.physics import focus_amplitude
from midair.rig import KeptCalibration, OpenRig, PlaySettings, RecordSettings, open_rig, play, record
from midair.settings import Settings

COARSE = ControlGrid(rows=6, columns=6, pitch=11e-3)
QUICK = Settings().but(grid=COARSE, method="fast")
ARRAY = TransducerArray.autd3()


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


TAKE = Recording(samples=np.random.default_rng(0).random((250, 4, 4)), rate=1000.0)


class Losing(ReplaySensor):
    """Skips a frame before its second block."""

    def read(self, frames):
        block = super().read(frames)
        shift = 1 if block.first else 0
        return FrameBlock(samples=block.samples, first=block.first + shift, device_time=0, host_time=0)


def test_a_source_that_ends_early_gives_what_there_was():
    with ReplaySensor(TAKE) as sensor:
        assert record(sensor, 10.0).recording.frames == 250
        assert record(sensor, settings=RecordSettings()).recording.frames == 250
        with pytest.raises(DeviceError, match="expected a touch, got none"):
            record(sensor, level=2.0)


def test_lost_frames_are_an_error_and_stop_the_sensor(tmp_path):
    with Losing(TAKE) as sensor:
        with pytest.raises(DeviceError, match=r"lost frames before 0\.050 s"):
            record(sensor, 0.25, path=tmp_path / "take.h5")
        with pytest.raises(Exception, match="start before read"):
            sensor.read(1)
    assert load(tmp_path / "take.h5").frames == 50, "what came before the loss is kept"


def test_a_take_in_memory_equals_the_one_in_a_file(tmp_path):
    """A touch with its pre-roll, a dead channel and clipping: samples, journal and provenance."""
    samples = np.random.default_rng(1).normal(0.0, 0.01, (900, 4, 4))
    samples[:, 0, 0] = 0.5
    samples[300:310, 1, 1] = 1.0
    takes = []
    for path in (None, tmp_path / "take.h5"):
        sensor = ReplaySensor(Recording(samples=samples, rate=1000.0))
        sensor.full_scale = 1.0
        with sensor:
            takes.append(record(sensor, 0.5, path=path, level=0.4, pre_roll=0.1))
    here, stored = takes
    np.testing.assert_array_equal(here.recording.samples, samples[200:800])
    np.testing.assert_array_equal(stored.recording.samples, here.recording.samples)
    assert {event.kind for event in here.journal} == {"trigger", "clipped", "dead"}
    assert stored.journal == here.journal
    assert stored.recording.provenance == here.recording.provenance


@pytest.mark.long
def test_a_solution_is_played_and_rerecorded_on_a_virtual_rig(solution):
    played = play(solution)
    assert played.outcome == "exceeded"
    assert played.take.recording.frames == 80
    pressure = midair.calibrate(played.take.recording, played.take.calibration)
    assert np.abs(pressure.pressure).max() > 1
    assert "heard: " in repr(played)
    assert len(repr(played)) < 600


@pytest.mark.long
def test_the_virtual_rig_can_have_other_air_than_the_drive(solution):
    here = play(solution).take.recording.samples
    with open_rig(acoustics=midair.Acoustics(medium=Medium.at(temperature=24.0))) as warm:
        there = play(solution, warm).take.recording.samples
    assert not np.allclose(here, there)


@pytest.mark.long
def test_settings_of_a_playback_can_be_given_in_either_place(solution):
    settings = PlaySettings(repeats=2, participant="touch/3")
    with open_rig(settings=settings, seed=1) as rig:
        assert rig.settings == settings.but(seed=1)
        assert rig.array.participant == "touch/3"
        assert play(solution, rig).take.recording.frames == 140
        assert play(solution, rig, repeats=None).take.recording.frames == 140
        assert play(solution, rig, repeats=1, participant="touch/4").take.recording.frames == 80
        assert rig.array.participant == "touch/4"
        with pytest.raises(InputError, match="settings of a playback, got silencer"):
            play(solution, rig, silencer="off")
    assert play(solution, settings=settings, seed=1).take.recording.frames == 140


@pytest.mark.long
def test_a_virtual_rig_fits_the_drive():
    """A drive of one unit, and cells that its provenance names: neither is the default of the virtual rig."""
    one, amplitude = TransducerArray.autd3(columns=1, rows=1), np.full((20, 36), 1.0)
    cells = midair.SensorGrid(rows=2, columns=3, pitch=8e-3)
    pressure = midair.PressureFrames(pressure=np.ones((20, 2, 3)), rate=1000.0, sensor=cells)
    target = midair.prepare(pressure, mapping="half-wave", grid=COARSE)
    made = midair.solve(replace(target, amplitude=amplitude), one, method="fast")
    assert play(made, "virtual").take.recording.sensor.shape == (2, 3)


def test_a_rig_that_was_not_entered_does_not_play(solution):
    with pytest.raises(DeviceStateError, match="open"):
        play(solution, open_rig())


@pytest.mark.long
def test_nothing_is_louder_than_the_rig_allows(solution):
    rig = OpenRig(array=Loud(ARRAY), sensor=None)
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


def test_an_array_is_closed_if_the_sensor_cannot_be_opened():
    class Missing(ReplaySensor):
        def open(self):
            raise DeviceError("missing: no such sensor")

    rig = open_rig()
    broken = replace(rig, sensor=Missing(Recording(samples=np.zeros((9, 4, 4)), rate=1000.0, unit="V")))
    with pytest.raises(DeviceError, match="no such sensor"), broken:
        pytest.fail("entered")
    with rig.array:
        pass


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


@pytest.mark.long
def test_a_loop_solves_for_the_measured_array_of_its_rig():
    pressure = midair.PressureFrames(pressure=np.random.default_rng(0).standard_normal((30, 4, 4)), rate=1000.0)
    known = calibration(ARRAY)
    with replace(open_rig(height=0.2), measured=KeptCalibration(known=known)) as rig:
        made = midair.loop(pressure, QUICK, rig, corrections=0)
    life = made.passes[0].reproduction.solution.drive.provenance
    assert life.last("solve")["array_calibration"] == life.last("array calibration")["id"] == known.identifier
    assert made.settings.compensation.dynamics.detuning == pytest.approx(1300.0)
