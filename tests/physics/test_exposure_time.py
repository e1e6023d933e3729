"""Frames that sound at once, because they arrive at different times, against the sum of all waves over time."""

from dataclasses import replace

import numpy as np
import pytest

from midair.model import Acoustics, Drive, TransducerArray
from midair.physics import ExposureProfile, Place, exposure, sound_level, transfer_matrix

WHOLE = TransducerArray.autd3()
FEW = TransducerArray(position=WHOLE.position[::8], normal=WHOLE.normal[::8])
SPEED = Acoustics().medium.speed
STEP = 25e-6


def profile(reach=0.0):
    ear = Place(name="ear", position=(-0.075, -0.35, 0.45), reach=reach, limit=110.0)
    return ExposureProfile(name="p", title="t", source="s", evidence="e", places=(ear,))


def drive(phase, rate, level=None):
    return Drive(phase=phase, level=np.ones(len(phase)) if level is None else level, rate=rate, array=FEW)


def over_time(told, point):
    """Highest rms over .25 ms of the sum of all waves in dB: each transducer changes when its next frame arrives."""
    waves, silence = transfer_matrix(np.array(point)[None], FEW)[0], np.zeros((1, FEW.count))
    change = np.diff(np.concatenate([silence, told.q, silence]), axis=0)
    late = np.linalg.norm(np.array(point) - FEW.position, axis=1) / SPEED
    when = (np.arange(len(change))[:, None] / told.rate + late - late.min()) / STEP
    jumps, when = (waves * change).ravel(), when.astype(int).ravel() + 1
    heard = np.cumsum(np.bincount(when, jumps.real) + 1j * np.bincount(when, jumps.imag))
    power = np.convolve(np.abs(np.append(heard, np.zeros(10))) ** 2, np.full(10, 0.1))
    return float(sound_level(np.sqrt(power.max())))


def turning(rate, turn):
    """A phase that turns alike for all, and that is in step at the ear only because of the times of arrival."""
    point = np.array(profile().places[0].position)
    late = np.linalg.norm(point - FEW.position, axis=1) / SPEED
    still = -np.angle(transfer_matrix(point[None], FEW)[0]) + 2 * np.pi * turn * late
    return drive(still + 2 * np.pi * turn * np.arange(24)[:, None] / rate, rate)


def test_what_arrives_at_once_counts_so_that_a_phase_that_turns_is_louder_than_each_frame():
    for rate in (1000.0, 4000.0, 8000.0):
        rng, point = np.random.default_rng(1), profile().places[0].position
        two = np.stack([turning(4000.0, 900.0).phase[0], rng.uniform(0, 6, FEW.count)])
        drives = {
            "turning": turning(rate, -0.2 * rate),
            "alternating": drive(np.tile(two, (8, 1)), rate),
            "random": drive(rng.uniform(0, 6, (30, FEW.count)), rate),
            "levels": drive(rng.uniform(0, 6, (30, FEW.count)), rate, rng.random((30, FEW.count))),
            "one frame": drive(two[1:], rate),
        }
        errors = {name: exposure(each, profile()).peak[0] - over_time(each, point) for name, each in drives.items()}
        assert all(-0.5 < each < 5 for each in errors.values()), (rate, errors)
    told = turning(8000.0, -1600.0)
    assert exposure(told, profile()).peak[0] > exposure(told, profile(), alone=True).peak[0] + 5


def test_the_end_of_a_drive_sounds_with_its_repeat():
    point = np.array(profile().places[0].position)
    focus = -np.angle(transfer_matrix(point[None], FEW)[0])
    late = np.linalg.norm(point - FEW.position, axis=1) / SPEED
    # At 4 kHz, near transducers are in step in the first frame, distant ones in the last.
    near = late < np.median(late)
    level = np.stack([near, np.zeros(FEW.count), np.zeros(FEW.count), ~near]).astype(float)
    told = drive(np.tile(focus, (4, 1)), 4000.0, level)
    once, often = (exposure(told, profile(), repeats=each).peak[0] for each in (1, 3))
    true = over_time(replace(told, phase=np.tile(told.phase, (3, 1)), level=np.tile(level, (3, 1))), point)
    assert often - true == pytest.approx(0, abs=2)
    assert often > once + 3


def test_parts_are_measured_as_the_whole():
    rng = np.random.default_rng(3)
    told = drive(rng.uniform(0, 6, (40, FEW.count)), 4000.0)
    whole = exposure(told, profile()).peak
    first = exposure(replace(told, phase=told.phase[:25], level=told.level[:25]), profile(), ends=False)
    rest = exposure(replace(told, phase=told.phase[5:], level=told.level[5:]), profile(), earlier=20)
    assert len(rest.level) == 15
    np.testing.assert_allclose(np.maximum(first.peak, rest.peak), whole, atol=1e-3)


def test_the_loudest_point_of_a_cube_is_found_over_time():
    rng = np.random.default_rng(4)
    told = drive(rng.uniform(0, 6, (12, FEW.count)), 4000.0)
    place = profile(reach=8e-3).places[0]
    true = max(over_time(told, np.array(place.position) + each) for each in rng.uniform(-8e-3, 8e-3, (200, 3)))
    assert -0.5 < exposure(told, profile(reach=8e-3)).peak[0] - true < 4


def quiet_by_arrivals_at_the_middle(place, aim, rate):
    """Two frames that alternate: loud at one point, and quiet in a cube if sound arrived as it does in its middle."""
    points = np.random.default_rng(1).uniform(-place.reach, place.reach, (150, 3)) + place.position
    path, there = (np.linalg.norm(each - FEW.position, axis=1) / SPEED for each in (place.position, aim))
    waves, wanted, lines = transfer_matrix(points, FEW), transfer_matrix(aim[None], FEW)[0], []
    for line in (0.0, -1j * np.pi):
        ages = ((np.ceil((path - path.min()) * rate - moment).clip(0)) for moment in (0, 0.25, 0.5, 0.75))
        seen = np.concatenate([waves * np.exp(line * age) for age in ages])
        normal, age = seen.conj().T @ seen, np.ceil((there - there.min()) * rate - 0.5).clip(0)
        normal += 1e-6 * np.abs(np.diag(normal)).max() * np.eye(FEW.count)
        lines.append(np.linalg.solve(normal, (wanted * np.exp(line * age)).conj()))
    q = np.tile([lines[0] + lines[1], lines[0] - lines[1]], (16, 1))
    return drive(np.angle(q), rate, (np.abs(q) / np.abs(q).max()).clip(0, 1))


def test_sound_that_arrives_earlier_at_a_corner_than_in_the_middle_counts():
    """5 dB too little without the octants of the cube, whose arrivals are their own."""
    ear = profile(reach=20e-3)
    aim = np.array(ear.places[0].position) + ear.places[0].reach
    told = quiet_by_arrivals_at_the_middle(ear.places[0], aim, 4000.0)
    assert -0.5 < exposure(told, ear).peak[0] - over_time(told, aim) < 8
