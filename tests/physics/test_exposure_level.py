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
    palm_warming,
    skin_warming,
    sound_level,
    transfer_matrix,
    unit_duty,
    unit_levels,
)
from midair.physics.exposure_level import nonlinearity_index
from midair.physics.exposure_modes import bands, between, lattice, middle, slow_field, stacks
from midair.physics.exposure_places import PUBLISHED_RISE, STRONG_FOCUS, combined

ONE = TransducerArray(position=np.zeros((1, 3)), normal=np.array([[0.0, 0.0, 1.0]]), pressure=4.0)
LOSSLESS = Acoustics(medium=Medium(attenuation=0))
ARRAY = TransducerArray.autd3()
PROFILE = profile_named("occupational-110")
EAR = PROFILE.places[0]


def profile(*places):
    return ExposureProfile(name="p", title="t", source="s", evidence="e", places=places)


def ear(z=2.0, limit=100.0, **options):
    return Place(**({"name": "ear", "position": (0.0, 0.0, z), "reach": 0.0, "limit": limit} | options))


def steady(level, frames=4):
    return Drive(phase=np.zeros((frames, 1)), level=np.full(frames, level), rate=1000.0, array=ONE)


def test_sound_levels_and_the_nonlinearity_of_a_plane_wave_by_hand():
    np.testing.assert_allclose(
        sound_level(np.array([np.sqrt(2), 10 * np.sqrt(2), 2e-5 * np.sqrt(2)])), [93.979, 113.979, 0], atol=1e-3
    )
    # sigma = beta k M x with M = p / (rho c2): 1.2 * 2 pi 40e3 * 1000 * 0.1 / (1.25 * 340^3).
    path = np.linspace(0, 0.1, 50)
    sigma = nonlinearity_index(np.full(50, 1000.0), path, Medium(), 40e3)
    assert sigma == pytest.approx(1.2 * 2 * np.pi * 40e3 * 100 / (1.25 * 340**3), rel=1e-9)


def test_one_transducer_by_hand_at_a_place_that_counts():
    """4 Pa m at 2 m on the axis is 2 Pa peak: 20 lg(2 / sqrt(2) / 20e-6) = 96.99 dB; half the level is 6.02 dB less."""
    found, half = (exposure(steady(level), profile(ear()), acoustics=LOSSLESS) for level in (1.0, 0.5))
    assert (found.peak[0], half.peak[0]) == pytest.approx((96.99, 90.97), abs=0.005)
    assert found.excess == pytest.approx(-3.01, abs=0.005)
    assert found.verdict().startswith("within the limit: 97.0 dB")
    both = profile(ear(limit=110.0), ear(z=0.1, limit=50.0, enforced=False))
    found = exposure(steady(1.0), both, acoustics=LOSSLESS)
    assert found.excess < 0
    assert found.worst[0].limit == 110


def test_mean_energy_dose_and_day():
    """A quarter of the frames at 2 Pa peak, the rest silent: mean square 0.5 Pa2, 93.98 - 3.01 dB."""
    drive = Drive(phase=np.zeros((1000, 1)), level=np.repeat([1.0, 0.0], [250, 750]), rate=1000.0, array=ONE)
    found = exposure(drive, profile(ear()), acoustics=LOSSLESS, repeats=10)
    assert found.mean[0] == pytest.approx(90.969, abs=0.005)
    assert found.duration == 10
    assert found.dose[0] == pytest.approx(0.5 * 10, rel=1e-6)
    assert found.daily[0] == pytest.approx(90.969 + 10 * np.log10(10 / 28800), abs=0.005)


def test_the_loudest_frame_counts():
    array = TransducerArray.autd3(columns=1, rows=1)
    place = ear(position=(0.1, -0.2, 0.4))
    rng = np.random.default_rng(0)
    drive = Drive(phase=rng.uniform(0, 6, (600, 249)), level=rng.random(600), rate=1000.0, array=array)
    found = exposure(drive, profile(place), alone=True)
    field = np.abs(drive.q @ transfer_matrix(place.points[:1], array).T)
    np.testing.assert_allclose(found.level[:, 0], sound_level(field[:, 0]), atol=1e-3)
    where, frame = found.worst
    assert where is place
    assert frame == field.argmax()
    assert f"frame {frame}" in found.where
    assert found.where.startswith("[ 100. -200.  400.] mm")


@pytest.mark.long
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
    random = replace(at_each, phase=np.random.default_rng(0).uniform(0, 7, phase.shape))
    assert exposure(random, profile(place)).peak[0] < most.peak[0]


def test_duty_and_warming_count_like_a_level_above_its_limit():
    """A minute at full drive is 6.02 dB above a duty of one half; 4 K instead of 1 K are 6.02 dB as well."""
    drive = Drive(phase=np.zeros((60, 1)), level=np.ones(60), rate=1.0, array=ONE)
    found = exposure(drive, profile(ear(limit=200.0)), acoustics=LOSSLESS)
    assert found.duty == pytest.approx([1.0])
    assert found.excess == pytest.approx(6.02, abs=0.005)
    assert "unit 0 at 1 of full drive over a minute, limit 0.5 (midair's own)" in found.verdict()
    warm = replace(profile(ear(limit=200.0)), duty=1.0, warming=found.warming / 4)
    found = exposure(drive, warm, acoustics=LOSSLESS)
    assert found.excess == pytest.approx(6.02, abs=0.005)
    assert "(estimate)" in found.verdict()
    short = exposure(steady(1.0), profile(ear()), acoustics=LOSSLESS)
    assert "palm" not in short.verdict()
    assert short.duty == pytest.approx([4e-3 / 60])


def test_points_of_a_cube_are_its_corners_faces_and_middle_or_closer_together():
    points = ear(position=(0.1, -0.2, 0.4), reach=0.03).points
    assert points.shape == (27, 3)
    np.testing.assert_allclose(points.min(axis=0), [0.07, -0.23, 0.37])
    np.testing.assert_allclose(points.max(axis=0), [0.13, -0.17, 0.43])
    np.testing.assert_allclose(points[13], [0.1, -0.2, 0.4])
    assert len(np.unique(points, axis=0)) == 27
    wide, close = (cone_points(EAR, ARRAY, Acoustics(), step=step) for step in (1.8, 0.9))
    for points in (wide, close):
        assert np.abs(points - np.array(EAR.position)).max() <= EAR.reach + 1e-9
        assert len(np.unique(points, axis=0)) == len(points)
    assert 3 * len(wide) < len(close)


def test_the_sound_of_random_errors_is_near_the_loudest_of_many_points():
    rng = np.random.default_rng(5)
    level = rng.uniform(0, 1, (2, ARRAY.count))
    drive = Drive(phase=rng.uniform(0, 6, level.shape), level=level, rate=1e3, array=ARRAY, acoustics=Acoustics())
    points = np.array(EAR.position) + rng.uniform(-EAR.reach, EAR.reach, (400, 3))
    G = transfer_matrix(points, ARRAY, acoustics=drive.acoustics)
    errors = 0.2 / np.sqrt(2) * (rng.normal(size=(20, 996)) + 1j * rng.normal(size=(20, 996)))
    loudest = [np.abs((drive.q * error) @ G.T).max() for error in errors]
    found = level_if_unlike(drive, PROFILE)[0]
    assert abs(found - sound_level(np.mean(loudest))) < 2
    shared = Drive(phase=drive.phase, level=np.ones(2), rate=1e3, array=ARRAY)
    assert level_if_unlike(shared, PROFILE, 0.2)[0] > found


def test_a_lattice_reaches_the_faces_crowds_there_and_carries_waves_between_its_nodes():
    axis = lattice(np.array([12.0, 4.0, 2.0]), 1.0)[0]
    assert (axis[0], axis[-1]) == (-1, 1)
    gaps = np.diff(axis)
    assert gaps.max() * 12 < 1.0
    assert gaps[0] < gaps[len(gaps) // 2]
    np.testing.assert_allclose(axis, -axis[::-1], atol=1e-12)
    nodes, at = lattice(np.array([8.0, 2.0, 2.0]), 1.6)[0], np.linspace(-1, 1, 50)
    for wave in (0.0, 3.3, 8.0):
        found = between(nodes, at, 8.0) @ np.exp(1j * wave * nodes)
        np.testing.assert_allclose(found, np.exp(1j * wave * at), atol=5e-3, err_msg=str(wave))


def test_the_slow_field_is_the_transfer_matrix_but_for_a_wave_and_turns_within_its_bands():
    share = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    points = np.array(EAR.position) + EAR.reach * share
    path = np.linalg.norm(points - middle(ARRAY), axis=1, keepdims=True)
    wave = np.exp(-1j * 2 * np.pi * ARRAY.frequency / Acoustics().medium.speed * path)
    true = transfer_matrix(points, ARRAY) * wave
    magnitude = np.abs(transfer_matrix(EAR.points, ARRAY))
    found = slow_field(share, place=EAR, array=ARRAY, acoustics=Acoustics(), magnitude=magnitude)
    np.testing.assert_allclose(found, true, atol=4e-3 * np.abs(true).max())
    # Two transducers on the x axis, seen from far above: sin = 0.1 on either side of the middle, k reach 0.1.
    array = TransducerArray(position=np.array([[-0.1, 0, 0], [0.1, 0, 0]]), normal=np.array([[0, 0, 1.0]] * 2))
    k = 2 * np.pi * array.frequency / Acoustics().medium.speed
    found = bands(ear(1.0, reach=0.05), array, Acoustics())
    assert found[0] == pytest.approx(k * 0.05 * 0.1, rel=0.06)
    np.testing.assert_allclose(found[1:], 2.0)


def test_stacks_are_the_inside_and_all_of_the_surface_each_point_once():
    found = [each.points.reshape(-1, 3) for each in stacks(np.array([3.0, 8.0, 5.0]), inside=1.6, faces=1.0)]
    assert (np.abs(found[0]) < 1).all()
    surface = np.concatenate(found[1:])
    assert (np.abs(surface).max(axis=1) == 1).all()
    assert len(np.unique(surface.round(9), axis=0)) == len(surface)
    closer = lattice(np.array([3.0, 8.0, 5.0]), 1.0)
    assert len(surface) == (np.abs(combined(*closer)).max(axis=1) == 1).sum()


PALM = np.array([[0.0, 0.0, 0.2]])


def still(seconds, level=1.0, rate=10.0):
    frames = round(seconds * rate)
    phase = np.repeat(focus_phase(ARRAY, PALM[0])[None], frames, axis=0)
    return Drive(phase=phase, level=np.full(frames, level), rate=rate, array=ARRAY)


def test_repeats_follow_each_other_without_silence():
    """A drive that does not fill its last part is not longer for it; the judge repeats frames one by one."""
    rng, rate = np.random.default_rng(3), 20.0
    for frames, repeats in ((1, 1200), (1, 2000), (7, 400), (33, 50), (1250, 2), (1250, 3)):
        level = rng.random((frames, ARRAY.count))
        drive = Drive(phase=np.zeros(level.shape), level=level, rate=rate, array=ARRAY)
        parts = unit_levels(drive, every=2)
        found = unit_duty(parts, rate / 2, duration=frames / rate, repeats=repeats)
        each = np.tile(unit_levels(drive), (repeats, 1))
        sums = np.concatenate([np.zeros((1, 4)), np.cumsum(each, axis=0)])
        width = min(1200, len(each))
        expected = (sums[width:] - sums[:-width]).max(axis=0) / 1200
        # Parts of two frames may begin a minute between two frames.
        np.testing.assert_allclose(found, expected, atol=1 / 1200 if frames > 1 else 1e-12)


def test_a_unit_is_the_mean_of_its_transducers_over_the_busiest_minute():
    level = np.zeros((3, ARRAY.count))
    level[1, ARRAY.unit == 2] = 0.8
    drive = Drive(phase=np.zeros(level.shape), level=level, rate=1.0, array=ARRAY)
    np.testing.assert_allclose(unit_levels(drive), [[0, 0, 0, 0], [0, 0, 0.8, 0], [0, 0, 0, 0]])
    common = Drive(phase=np.zeros(level.shape), level=np.array([0.1, 0.2, 0.3]), rate=1.0, array=ARRAY)
    np.testing.assert_allclose(unit_levels(common), np.repeat([[0.1], [0.2], [0.3]], 4, axis=1))
    level = np.zeros((90, 2))
    level[:30, 0], level[40:80, 1] = 1.0, 0.5
    assert unit_duty(level, 1.0) == pytest.approx([30 / 60, 20 / 60])
    assert unit_duty(np.ones((10, 1)), 1.0) == pytest.approx([10 / 60]), "silence follows"
    assert unit_duty(np.ones((10, 1)), 1.0, repeats=3) == pytest.approx([30 / 60])
    assert unit_duty(np.ones((10, 1)), 1.0, repeats=10**6) == pytest.approx([1.0])
    assert unit_duty(np.tile([[1.0], [0.0]], (50, 1)), 1.0, repeats=7) == pytest.approx([0.5])


def test_constant_and_rising_heat_follow_the_closed_form_of_a_thick_body():
    """A constant flow warms with the square root of time; one that rises by a t with a k (2/3) t^1.5."""
    step, count = 0.01, 1000
    time = (np.arange(count) + 1) * step
    constant = skin_warming(np.full(count, STRONG_FOCUS), step)
    np.testing.assert_allclose(constant, PUBLISHED_RISE * np.sqrt(time / 5.0), rtol=1e-9)
    rising = skin_warming(STRONG_FOCUS * (time - step / 2), step)
    np.testing.assert_allclose(rising[100:], (PUBLISHED_RISE / np.sqrt(5.0) * 2 / 3 * time**1.5)[100:], rtol=2e-3)


def test_a_still_focus_warms_as_published_and_a_weaker_one_by_the_square_of_its_level():
    found = palm_warming(still(5.0), PALM, acoustics=Acoustics())
    amplitude = np.abs(transfer_matrix(PALM, ARRAY)).sum()
    medium = Acoustics().medium
    share = amplitude**2 / (2 * medium.density * medium.speed) / STRONG_FOCUS
    assert found == pytest.approx(PUBLISHED_RISE * share, rel=1e-4)
    assert share == pytest.approx(1.0, rel=0.1), "the assumed strong focus is that of four units"
    assert palm_warming(still(5.0, level=0.5), PALM, acoustics=Acoustics()) == pytest.approx(found / 4, rel=1e-4)
    assert palm_warming(still(1.0), PALM, acoustics=Acoustics(), repeats=5) == pytest.approx(found, rel=1e-4)
    minute = palm_warming(still(60.0), PALM, acoustics=Acoustics())
    assert minute == pytest.approx(found * np.sqrt(12), rel=1e-4)
    assert palm_warming(still(70.0), PALM, acoustics=Acoustics()) == pytest.approx(minute, rel=1e-4)


def test_a_modulated_focus_warms_as_its_mean_intensity_whatever_its_period(subtests, monkeypatch):
    """All frames, or some of a long drive."""
    drive, steady = still(5.0, rate=1000.0), palm_warming(still(5.0), PALM, acoustics=Acoustics())
    for period, few in [(2, 5000), (7, 5000), (7, 1500), (8, 1500), (20, 1500)]:
        with subtests.test(period=period, few=few):
            monkeypatch.setattr("midair.physics.exposure_places._FRAMES", few)
            modulated = replace(drive, level=(np.arange(drive.frames) % period < period / 2).astype(float))
            found, mean = palm_warming(modulated, PALM, acoustics=Acoustics()), modulated.level.mean() * steady
            assert found == pytest.approx(mean, rel=0.01 if few == 5000 else 0.1)
