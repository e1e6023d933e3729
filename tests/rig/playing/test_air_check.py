import re
from dataclasses import replace

import numpy as np
import pytest

from midair.evaluate import error_at_temperature
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Medium, TransducerArray
from midair.rig.playing.air_check import check_air
from midair.solvers import solve

ARRAY = TransducerArray.autd3(columns=1, rows=1)
OWN = Medium.at(temperature=22.0, humidity=0.5)


@pytest.fixture(scope="module")
def target():
    amplitude = 300.0 * np.random.default_rng(0).random((5, 36))
    return AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=ControlGrid(rows=6, columns=6, pitch=11e-3))


@pytest.fixture(scope="module")
def drive(target):
    return solve(target, ARRAY, method="fast", acoustics=Acoustics(medium=OWN)).drive


def never():
    raise AssertionError("the target is read where it matters only")


def test_an_unknown_room_temperature_is_reported_and_not_guessed(drive):
    found = check_air(drive, None, never)
    assert found.warns
    assert "room temperature unknown: the drive was solved for 22 °C, 50 % humidity" in found.said


def test_a_virtual_array_has_the_drive_s_own_air(drive):
    found = check_air(drive, None, never, simulated=True)
    assert (found.said, found.warns) == ("air: 22 °C, 50 % humidity, the drive's own", False)


def test_two_degrees_are_near_enough(subtests, drive):
    for temperature in [20.0, 24.0]:
        with subtests.test(temperature=temperature):
            found = check_air(drive, Medium.at(temperature=temperature), never)
            assert not found.warns
            assert f"the room has {temperature:g} °C" in found.said


@pytest.mark.parametrize("temperature", [19.9, 24.1, 30.0])
def test_more_than_two_degrees_are_reported_with_the_error(drive, target, temperature):
    room = Medium.at(temperature=temperature)
    found = check_air(drive, room, lambda: target)
    assert found.warns
    here, own, frames = re.search(r"E ([\d.]+) % instead of ([\d.]+) %, the mean of (\d+) frames", found.said).groups()
    assert float(here) == pytest.approx(100 * error_at_temperature(drive, target, room).mean(), abs=0.05)
    assert float(own) == pytest.approx(100 * error_at_temperature(drive, target, OWN).mean(), abs=0.05)
    assert int(frames) == 5


def test_a_drive_for_the_paper_s_air_is_one_for_14_degrees(drive, target):
    old = replace(drive, acoustics=Acoustics())
    assert not check_air(old, Medium.at(temperature=14.0), never).warns
    said = check_air(old, OWN, lambda: target).said
    assert "solved for 340 m/s (14 °C): E " in said


def test_without_a_target_the_cost_is_not_known_and_silence_has_none(drive, target):
    warm = Medium.at(temperature=30.0)
    assert "the file has no target" in check_air(drive, warm, lambda: None).said
    silent = replace(target, amplitude=np.zeros((5, 36)))
    assert "the drive is silent" in check_air(drive, warm, lambda: silent).said
