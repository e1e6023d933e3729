"""The whole loop on the virtual rig, on the stimuli of the paper's section 5.2."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from midair.devices import VirtualSensor
from midair.evaluate import compare, metrics_or_none
from midair.model import ControlGrid, PressureFrames, SensorGrid, TransducerArray
from midair.pipeline import calibrated_pressure, required_lead
from midair.rig import OpenRig, record
from midair.rig import loop as run_loop
from midair.rig.correction.correction_loop import beam_test, expected_gain, focus_on_cell
from midair.rig.names.sensor_names import VirtualRig
from midair.settings import Settings
from midair.targets import add_lead

RIG = VirtualRig()
# Half of the paper's points, and not the paper's method: the fast suite asks for the right place and time, not for E.
COARSE = Settings().but(grid=ControlGrid(rows=11, columns=11, pitch=5.5e-3), method="fast")
PEAKS = {"am-i": [0], "am-ii": [0, 15], "am-iii": [0]}
FREQUENCY = {"am-i": 100, "am-ii": 100, "am-iii": 25}


def original(stimulus, settings, duration):
    with RIG.touched_by(stimulus, duration=duration) as sensor:
        return calibrated_pressure(record(sensor, duration).recording, sensor.calibration, settings)


@cache
def loop(stimulus, settings, duration):
    skin = RIG.skin()
    with OpenRig(array=RIG.array_device(skin), sensor=RIG.sensor(skin)) as rig:
        return run_loop(original(stimulus, settings, duration), settings, rig, lead=0.0)


def check(done, stimulus, model=0.1, measured=0.02):
    first, last = done.passes
    strongest = np.argsort((last.felt.pressure**2).mean(axis=0).ravel())[::-1][: len(PEAKS[stimulus])]
    assert sorted(strongest) == PEAKS[stimulus]
    assert last.comparison.frequency == (FREQUENCY[stimulus], FREQUENCY[stimulus])
    assert last.comparison.correlation > 0.85
    # The first level is the model's, the second one measured.
    assert first.comparison.gain == pytest.approx(1, abs=model)
    assert last.comparison.gain == pytest.approx(1, abs=measured)
    # Sound presses, it does not pull: half a wave has .42 of its amplitude at twice the frequency.
    pressed = dataclasses.replace(done.reference, pressure=np.maximum(done.reference.pressure, 0))
    rectified, felt = (
        metrics_or_none(done.reference, each).figure("other frequencies").overall for each in (pressed, last.felt)
    )
    assert felt == pytest.approx(rectified, rel=0.1, abs=1)
    assert last.comparison.simulated


@pytest.mark.parametrize(
    "stimulus", [pytest.param(each, marks=[] if each == "am-iii" else pytest.mark.slow) for each in PEAKS]
)
@pytest.mark.long
def test_right_place_right_frequency_and_better_after_correction(stimulus):
    check(loop(stimulus, COARSE, 0.12), stimulus)


@pytest.mark.slow
def test_the_same_with_the_paper_s_settings():
    """The model has no error of the solver: first passes are 1.12 to 1.15 times as strong, second ones within 3 %.

    Both depend on which minima `lm` ends in: relative changes of the field of 1e-13 move them by that much.
    """
    check(done := loop("am-iii", Settings().but(method="lm"), 0.2), "am-iii", model=0.17, measured=0.04)
    assert done.passes[-1].reproduction.solution.error.mean() < 0.06


class Perfect(VirtualSensor):
    """Records the beam test, and afterwards returns the target pressure whatever is played."""

    wanted: PressureFrames
    starts = 0

    def start(self):
        self.starts += 1
        super().start()

    def _sense(self, frames):
        if self.starts == 1:
            return super()._sense(frames)
        times, length = round(self.wanted.rate / self.rate), 2 * (frames + 1000)
        spectrum = np.fft.rfft(self.wanted.pressure, length * times, axis=0)[: length // 2]
        response = self.calibration.response_at(np.fft.rfftfreq(length, 1 / self.rate)[:-1])
        return np.fft.irfft(spectrum * response / times, length, axis=0)[:frames]


@pytest.mark.long
@pytest.mark.parametrize("mapping", ["half-wave", "slow-bias"])
def test_a_perfect_chain_scores_above_60_db(mapping):
    """A part cut inside a touch is re-recorded without error: nothing is lost, and there is nothing to correct."""
    grid = ControlGrid(rows=4, columns=4, pitch=11e-3)
    settings = Settings().but(grid=grid, method="fast", iterations=1, mapping=mapping)
    with RIG.touched_by("towel", duration=0.7) as sensor:
        piece = calibrated_pressure(record(sensor, 0.7).recording, sensor.calibration, settings).cut(0.55, 0.1)
    lead = required_lead(settings)
    skin = RIG.skin()
    perfect = Perfect(skin, rate=RIG.rate)
    perfect.wanted = add_lead(piece, lead)
    with OpenRig(array=RIG.array_device(skin), sensor=perfect) as rig:
        done = run_loop(piece, settings, rig, corrections=0, lead=lead)
    comparison = done.passes[0].comparison
    assert comparison.distortion_ratio > 60
    assert comparison.waveform_error < 1e-3
    assert abs(comparison.delay) < 1e-6
    # Compared with the unfiltered original, the score would be lower.
    assert compare(piece, done.passes[0].felt).distortion_ratio < 30


@pytest.mark.long
def test_the_beam_s_gain_is_straight_and_repeats():
    skin = RIG.skin()
    with OpenRig(array=RIG.array_device(skin), sensor=RIG.sensor(skin)) as rig:
        tests = [beam_test(rig, COARSE, top=top) for top in (100.0, 50.0)]
    for test in tests:
        assert test.channel == 5
        # The virtual array's transducers are .9 as strong as assumed, and pressure goes with the square.
        assert test.line.gain == pytest.approx(0.81, rel=0.03)
        assert test.line.gain_error < 0.01 * test.line.gain
    assert tests[0].line.gain == pytest.approx(tests[1].line.gain, rel=0.02)


BEST = Settings().but(mapping="slow-bias", rate=4000.0, interpolate="pressure", decouple=True, precompensate=True)


def tone(frequency, rate, duration=0.2):
    """A tone in one inner cell, from rest to rest."""
    time = np.arange(round(duration * rate)) / rate
    pressure = np.zeros((len(time), 4, 4))
    pressure[:, 1, 1] = 5 * np.sin(2 * np.pi * frequency * time) * np.sin(np.pi * time / duration)
    return PressureFrames(pressure=pressure, rate=rate, band=(20.0, 470.0))


def gain(settings, frequency=100.0, duration=0.2):
    original = tone(frequency, settings.target.rate, duration)
    return expected_gain(original, add_lead(original, required_lead(settings)), settings)


def test_with_full_compensation_the_gain_is_one_and_less_of_half_a_wave_or_beyond_the_cell():
    assert gain(BEST) == pytest.approx(1, abs=0.01)
    assert gain(BEST.but(gain=2.0)) == pytest.approx(2, abs=0.02)
    assert gain(BEST.but(mapping="half-wave")) == pytest.approx(0.5, abs=0.02)
    assert gain(BEST.but(decouple=False)) < 0.85
    # At 1 kHz a change of 200 Hz loses sinc(.2) = .935 to the hold, and 1 / sqrt(1 + (2 pi 200 188e-6)^2) = .973.
    slow = BEST.but(rate=1000.0, precompensate=False)
    assert gain(slow, 200.0) / gain(slow, 25.0) == pytest.approx(0.935 * 0.973, abs=0.03)
    long = tone(100.0, 1000.0, duration=3.0)
    settings = BEST.but(rate=1000.0)
    assert expected_gain(long, add_lead(long, 0.15), settings) == pytest.approx(1, abs=0.03)


def test_a_focus_presses_less_on_a_cell_than_in_its_middle():
    array = TransducerArray.autd3()
    wide = focus_on_cell(array, SensorGrid(), 5, Settings())
    higher = focus_on_cell(array, SensorGrid(), 5, Settings().but(grid=ControlGrid(height=0.3)))
    assert 0 < higher < wide < 0.5 * 14.7e3


def test_cells_of_any_number_and_pitch(subtests):
    for rows, columns, pitch in [(3, 3, 11e-3), (4, 4, 6e-3), (2, 3, 13e-3)]:
        with subtests.test(rows=rows):
            cells = SensorGrid(rows=rows, columns=columns, pitch=pitch)
            wave = tone(100.0, 4000.0).pressure[:, :1, 1:2] + tone(100.0, 4000.0).pressure[:, 1:2, 1:2]
            original = PressureFrames(
                pressure=wave * np.ones((rows, columns)), rate=4000.0, sensor=cells, band=(20.0, 470.0)
            )
            assert expected_gain(original, add_lead(original, required_lead(BEST)), BEST) == pytest.approx(1, abs=0.02)
