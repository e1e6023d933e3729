from dataclasses import replace

import numpy as np
import pytest

from midair.files import load_profiles, profile_named
from midair.model import Acoustics, Drive, Medium, TransducerArray
from midair.physics import (
    ExposureProfile,
    Place,
    cone_points,
    exposure,
    focus_phase,
    greatest_exposure,
    level_if_unlike,
    sound_level,
    transfer_matrix,
)
from midair.physics.exposure_level import nonlinearity_index

ONE = TransducerArray(position=np.zeros((1, 3)), normal=np.array([[0.0, 0.0, 1.0]]), pressure=4.0)
AIR = Medium(attenuation=0)
ARRAY = TransducerArray.autd3()
PROFILE = profile_named("occupational-110")


def profile(*places):
    return ExposureProfile(name="p", title="t", source="s", evidence="e", places=places)


def ear(z=2.0, limit=100.0, **options):
    return Place(name="ear", position=(0.0, 0.0, z), reach=0.0, limit=limit, **options)


def steady(level, frames=4):
    return Drive(phase=np.zeros((frames, 1)), level=np.full(frames, level), rate=1000.0, array=ONE)


def test_level_of_one_pascal_is_94_db():
    np.testing.assert_allclose(
        sound_level(np.array([np.sqrt(2), 10 * np.sqrt(2), 2e-5 * np.sqrt(2)])), [93.979, 113.979, 0], atol=1e-3
    )


def test_one_transducer_by_hand():
    """4 Pa m at 2 m on the axis is 2 Pa peak: 20 lg(2 / sqrt(2) / 20e-6) = 96.99 dB; half the level is 6.02 dB less."""
    found = exposure(steady(1.0), profile(ear()), acoustics=Acoustics(medium=AIR))
    assert found.peak[0] == pytest.approx(96.99, abs=0.005)
    assert exposure(steady(0.5), profile(ear()), acoustics=Acoustics(medium=AIR)).peak[0] == pytest.approx(
        90.97, abs=0.005
    )
    assert found.excess == pytest.approx(-3.01, abs=0.005)
    assert "kept" in found.verdict()


def test_mean_energy_dose_and_day():
    """A quarter of the frames at 2 Pa peak, the rest silent: mean square 0.5 Pa2, 93.98 - 3.01 dB."""
    drive = Drive(phase=np.zeros((1000, 1)), level=np.repeat([1.0, 0.0], [250, 750]), rate=1000.0, array=ONE)
    found = exposure(drive, profile(ear()), acoustics=Acoustics(medium=AIR), repeats=10)
    assert found.mean[0] == pytest.approx(90.969, abs=0.005)
    assert found.duration == 10
    assert found.dose[0] == pytest.approx(0.5 * 10, rel=1e-6)
    assert found.daily[0] == pytest.approx(90.969 + 10 * np.log10(10 / 28800), abs=0.005)


def test_the_loudest_frame_counts():
    array = TransducerArray.autd3(columns=1, rows=1)
    place = Place(name="ear", position=(0.1, -0.2, 0.4), reach=0.0, limit=100.0)
    rng = np.random.default_rng(0)
    drive = Drive(phase=rng.uniform(0, 6, (600, 249)), level=rng.random(600), rate=1000.0, array=array)
    found = exposure(drive, profile(place))
    field = np.abs(drive.q @ transfer_matrix(place.points[:1], array).T)
    np.testing.assert_allclose(found.level[:, 0], sound_level(field[:, 0]), atol=1e-3)
    where, frame = found.worst
    assert where is place
    assert frame == field.argmax()
    assert f"frame {frame}" in found.verdict()
    assert "100 -200 400 mm" in found.verdict()


def test_places_that_only_advise_do_not_count():
    found = exposure(
        steady(1.0), profile(ear(limit=110.0), ear(z=0.1, limit=50.0, enforced=False)), acoustics=Acoustics(medium=AIR)
    )
    assert found.excess < 0
    assert found.worst[0].limit == 110


def test_nonlinearity_of_a_plane_wave_in_closed_form():
    """sigma = beta k M x with M = p / (rho c2): 1.2 * 2 pi 40e3 * 1000 * 0.1 / (1.25 * 340^3)."""
    path = np.linspace(0, 0.1, 50)
    sigma = nonlinearity_index(np.full(50, 1000.0), path, Medium(), 40e3)
    assert sigma == pytest.approx(1.2 * 2 * np.pi * 40e3 * 100 / (1.25 * 340**3), rel=1e-9)


def test_a_full_focus_of_four_units_is_far_from_linear_and_far_too_loud():
    array = TransducerArray.autd3()
    drive = Drive(phase=focus_phase(array, np.array([0, 0, 0.2]))[None], level=np.ones(1), rate=1000.0, array=array)
    profiles = load_profiles()
    found = exposure(drive, profiles["occupational-110"])
    assert found.nonlinearity == pytest.approx(2.2, abs=0.3)
    assert 135 < found.peak[0] < 150
    assert 170 < found.peak[-1] < 178
    assert exposure(drive, profiles["public-100"]).excess == pytest.approx(found.excess + 10, abs=1e-3)


def test_the_greatest_exposure_is_that_of_all_transducers_in_step_at_the_loudest_point():
    array, place = TransducerArray.autd3(columns=1, rows=1), ear(limit=100.0)
    most = greatest_exposure(array, 0.3, profile(place), rate=1000.0, airs=(Acoustics(),))
    phase = np.stack([focus_phase(array, point) for point in place.points])
    at_each = Drive(phase=phase, level=np.full(27, 0.3), rate=1000.0, array=array)
    assert most.peak[0] == pytest.approx(exposure(at_each, profile(place)).peak[0], abs=1e-3)
    random = Drive(
        phase=np.random.default_rng(0).uniform(0, 7, phase.shape), level=np.full(27, 0.3), rate=1000.0, array=array
    )
    assert exposure(random, profile(place)).peak[0] < most.peak[0]


def test_duty_and_warming_count_like_a_level_above_its_limit():
    """A minute at full drive is 6.02 dB above a duty of one half; 4 K instead of 1 K are 6.02 dB as well."""
    drive = Drive(phase=np.zeros((60, 1)), level=np.ones(60), rate=1.0, array=ONE)
    found = exposure(drive, profile(ear(limit=200.0)), acoustics=Acoustics(medium=AIR))
    assert found.duty == pytest.approx([1.0])
    assert found.excess == pytest.approx(6.02, abs=0.005)
    assert "unit 0 at 1 of full drive over a minute, limit 0.5 (midair's own)" in found.verdict()
    warm = replace(profile(ear(limit=200.0)), duty=1.0, warming=found.warming / 4)
    found = exposure(drive, warm, acoustics=Acoustics(medium=AIR))
    assert found.excess == pytest.approx(6.02, abs=0.005)
    assert "(estimate)" in found.verdict()
    short = exposure(steady(1.0), profile(ear()), acoustics=Acoustics(medium=AIR))
    assert "palm" not in short.verdict()
    assert short.duty == pytest.approx([4e-3 / 60])


def test_the_cube_of_a_place_is_looked_at_in_its_corners_its_faces_and_its_middle():
    points = Place(name="ear", position=(0.1, -0.2, 0.4), reach=0.03, limit=100.0).points
    assert points.shape == (27, 3)
    np.testing.assert_allclose(points.min(axis=0), [0.07, -0.23, 0.37])
    np.testing.assert_allclose(points.max(axis=0), [0.13, -0.17, 0.43])
    np.testing.assert_allclose(points[13], [0.1, -0.2, 0.4])
    assert len(np.unique(points, axis=0)) == 27


def test_points_lie_in_the_cube_and_closer_steps_make_more_of_them():
    ear = PROFILE.places[0]
    wide, close = (cone_points(ear, ARRAY, Acoustics(), step=step) for step in (1.8, 0.9))
    for points in (wide, close):
        away = np.abs(points - np.array(ear.position)).max(axis=1)
        assert away.max() <= ear.reach + 1e-9
        assert len(np.unique(points, axis=0)) == len(points)
    assert 3 * len(wide) < len(close)


def test_the_sound_of_random_errors_is_near_the_loudest_of_many_points():
    rng = np.random.default_rng(5)
    level = rng.uniform(0, 1, (2, ARRAY.count))
    drive = Drive(phase=rng.uniform(0, 6, level.shape), level=level, rate=1e3, array=ARRAY, acoustics=Acoustics())
    ear = PROFILE.places[0]
    points = np.array(ear.position) + rng.uniform(-ear.reach, ear.reach, (400, 3))
    G = transfer_matrix(points, ARRAY, acoustics=drive.acoustics)
    errors = 0.2 / np.sqrt(2) * (rng.normal(size=(20, 996)) + 1j * rng.normal(size=(20, 996)))
    loudest = [np.abs((drive.q * error) @ G.T).max() for error in errors]
    found = level_if_unlike(drive, PROFILE)[0]
    assert abs(found - sound_level(np.mean(loudest))) < 2
    shared = Drive(phase=drive.phase, level=np.ones(2), rate=1e3, array=ARRAY)
    assert level_if_unlike(shared, PROFILE, 0.2)[0] > found
