from dataclasses import replace

import numpy as np
import pytest
from tests.palms import palm_path

from midair.correct import IterativeCorrection
from midair.datasets import probe_signal
from midair.errors import InputError
from midair.evaluate import compare
from midair.model import ControlGrid, TransducerArray
from midair.pipeline import calibrated_pressure, required_lead
from midair.rig import OpenRig, open_rig, record
from midair.rig import loop as run_loop
from midair.rig.correction.iteration import playable, run_iterations
from midair.rig.names.sensor_names import VirtualRig
from midair.settings import Settings

RIG = VirtualRig()
SMALL = VirtualRig(array=TransducerArray.autd3(columns=1, rows=1))
COARSE = Settings().but(grid=ControlGrid(rows=6, columns=6, pitch=11e-3), method="fast", interpolate="pressure")


def original(settings, duration=0.08):
    skin = RIG.skin()
    touch = probe_signal("25+250 Hz", duration=duration, rate=skin.rate, sensor=skin.model.grid)
    with RIG.sensor(skin, touch=touch) as sensor:
        took = record(sensor, duration + 0.2).recording
        return calibrated_pressure(took, sensor.calibration, settings).cut(0.1, duration)


def looped(settings, iterate, virtual=RIG, **others):
    skin = virtual.skin()
    with OpenRig(array=virtual.array_device(skin), sensor=virtual.sensor(skin)) as rig:
        return run_loop(original(settings), settings, rig, iterate=iterate, lead=required_lead(settings) / 2, **others)


@pytest.mark.long
def test_each_of_more_than_five_passes_is_better_than_the_one_before():
    """Half a wave becomes 6 dB better: on the paper's grid it starts at 6 dB, with six points a side lower."""
    long = looped(COARSE, 6)
    errors = [one.comparison.waveform_error for one in long.passes[1:]]
    assert len(errors) == 7
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.5 * errors[0]
    assert long.end == "6 steps were made"
    assert np.ptp([one.comparison.delay for one in long.passes]) < 1e-4
    before, after = long.passes[1].comparison, long.passes[-1].comparison
    assert before.distortion_ratio < 7
    assert after.distortion_ratio > before.distortion_ratio + 6


@pytest.mark.long
def test_a_step_that_makes_it_worse_is_taken_back_and_smaller_ones_are_tried(loop, monkeypatch):
    """On a rig where every correction increases the error: three steps, each smaller, none kept."""
    start, tried = loop.passes[1], []

    def worse(original, asked, rig, settings, name, stage, *, step, made, **_):
        tried.append(step)
        return replace(start, step=step, comparison=replace(start.comparison, waveform_error=2.0))

    monkeypatch.setattr("midair.rig.correction.iteration.play_pass", worse)
    smaller = IterativeCorrection(smallest=0.15)
    passes, taken_back, end = run_iterations(loop.original, start, open_rig(), COARSE, 9, correction=smaller)
    assert tried == [0.8, 0.4, 0.2]
    assert (passes, taken_back) == ((), 3)
    assert end == "no step makes it better"


def test_it_stops_when_it_no_longer_helps(loop, monkeypatch):
    """The second step hardly helps; the target of each pass states all steps before it."""
    start, lowered = loop.passes[1], iter((0.5, 0.49999))

    def hardly(original, asked, rig, settings, name, stage, *, step, made, **_):
        better = start.comparison.waveform_error * next(lowered)
        return replace(start, step=step, asked=asked, comparison=replace(start.comparison, waveform_error=better))

    monkeypatch.setattr("midair.rig.correction.iteration.play_pass", hardly)
    passes, _, end = run_iterations(loop.original, start, open_rig(), COARSE, 9)
    assert "less than 0.2 %" in end
    stages = [[step.stage for step in one.asked.provenance.steps] for one in passes]
    assert [each.count("correct") for each in stages] == [1, 2]
    assert [one.step for one in passes] == [0.8, 0.8]


def test_a_palm_that_lies_aside_counts_as_distortion_at_a_fixed_place():
    aside = replace(SMALL, palm=palm_path(np.zeros(1), np.array([[6e-3, 0.0, SMALL.height]])))
    done = looped(COARSE, 0, aside, corrections=0, fixed_place=True)
    fixed, free = done.passes[-1].comparison, compare(done.reference, done.passes[-1].felt)
    assert (bool(fixed.place), free.place.shift[0]) == (False, pytest.approx(-6e-3, abs=0.7e-3))
    assert fixed.distortion_ratio < free.distortion_ratio - 6


def test_the_target_is_limited_to_playable_pressure():
    asked = np.array([-5.0, 3.0, 99.0])
    assert playable(asked, mapping="half-wave", top=10.0).tolist() == [0.0, 3.0, 10.0]
    assert playable(asked, mapping="slow-bias", top=10.0).tolist() == [-5.0, 3.0, 10.0]


def test_numbers_below_zero_are_refused():
    with pytest.raises(InputError, match="0 to 100"):
        looped(COARSE, -1)
    with pytest.raises(InputError, match="lead"):
        run_loop(original(COARSE), COARSE, open_rig(), lead=-1.0)


@pytest.mark.long
def test_where_all_cells_sound_the_drive_itself_is_corrected():
    """The second pass is the last that is solved: those after it play its drive, a little turned."""
    grid = ControlGrid(rows=12, columns=12, pitch=5e-3)
    lifted = looped(COARSE.but(mapping="slow-bias", grid=grid), 2)
    errors = [one.comparison.waveform_error for one in lifted.passes[1:]]
    assert errors[2] < errors[1] < 0.8 * errors[0]
    first, last = (one.reproduction.solution.drive for one in (lifted.passes[1], lifted.passes[-1]))
    assert [step.stage for step in last.provenance.steps].count("correct the drive") == 2
    turned = np.angle(np.exp(1j * (np.asarray(last.phase) - np.asarray(first.phase))))
    assert 0 < np.sqrt((turned**2).mean()) < 0.1
