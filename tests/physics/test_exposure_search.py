"""The loudest sound in a cube is found wherever it is: random drives, foci anywhere, and a search for gaps."""

from dataclasses import replace

import numpy as np
import pytest

from midair.files import profile_named
from midair.model import Acoustics, Drive, Medium, TransducerArray
from midair.physics import ExposureProfile, Place, exposure, focus_phase, sound_level, transfer_matrix
from midair.physics.exposure_search import ALLOWANCE, cone_points, cube_search

ARRAY = TransducerArray.autd3()
PROFILE = profile_named("occupational-110")
EAR = PROFILE.places[0]
MISSED = 0.5
"""What the docs promise: never further below the loudest place, in dB."""


def alone(place):
    return ExposureProfile(name="p", title="t", source="s", evidence="e", places=(place,))


def small(reach=8e-3, **options):
    return Place(name="ear", position=EAR.position, reach=reach, limit=110.0, **options)


def drive(phase, level=1.0, array=ARRAY, acoustics=None):
    return Drive(
        phase=phase,
        level=np.full(len(phase), level) if np.isscalar(level) else level,
        rate=1000.0,
        array=array,
        acoustics=acoustics or Acoustics(),
    )


def grid(place, wavelength=8.5e-3):
    """A tenth of a wavelength apart, faces included."""
    count = int(np.ceil(20 * place.reach / wavelength)) + 1
    steps = np.linspace(-place.reach, place.reach, count)
    return np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3) + place.position


def somewhere(place, count, rng):
    """Points of its cube, a third of them on its surface."""
    share = rng.uniform(-1, 1, (count, 3))
    face = np.arange(0, count, 3)
    share[face, rng.integers(0, 3, len(face))] = rng.choice([-1, 1], len(face))
    return np.array(place.position) + place.reach * share


def test_random_drives_on_a_grid_of_a_tenth_of_a_wavelength():
    place, rng = small(), np.random.default_rng(1)
    told = drive(rng.uniform(0, 2 * np.pi, (100, ARRAY.count)), rng.random((100, ARRAY.count)))
    true = sound_level(np.abs(told.q @ transfer_matrix(grid(place), ARRAY).T).max(axis=1))
    missed = true - exposure(told, alone(place)).level[:, 0]
    assert missed.max() < MISSED
    # A ceiling that refuses everything would be no gate.
    assert -2 < np.median(missed) < 0


@pytest.mark.parametrize("place", PROFILE.places[:3], ids=lambda place: place.name)
def test_foci_anywhere_in_the_cube(place):
    points = somewhere(place, 200, np.random.default_rng(2))
    told = drive(np.stack([focus_phase(ARRAY, point) for point in points]))
    true = sound_level(np.abs((told.q * transfer_matrix(points, ARRAY)).sum(axis=1)))
    over = exposure(told, alone(place)).level[:, 0] - true
    assert over.min() > -MISSED
    assert over.max() < 2.0


def test_a_search_for_gaps_finds_none_of_half_a_decibel():
    """Phases that are changed, step by step, to be loud at one point and quiet wherever the field is looked at."""
    rng = np.random.default_rng(3)
    looked_at = transfer_matrix(cone_points(EAR, ARRAY, Acoustics()), ARRAY).astype(np.complex64)
    wanted = transfer_matrix(somewhere(EAR, 9, rng), ARRAY).astype(np.complex64)
    phase = -np.angle(wanted)
    at_first, pace = phase.copy(), np.zeros_like(phase)
    for step in range(60):
        q = np.exp(1j * phase).astype(np.complex64)
        seen, there = q @ looked_at.T, (q * wanted).sum(axis=1, keepdims=True)
        size = np.abs(seen)
        weight = (size / size.max(axis=1, keepdims=True)) ** (8 + step)  # Nearly the loudest alone, at the end.
        weight /= weight.sum(axis=1, keepdims=True)
        uphill = wanted / there - (weight / size**2 * seen.conj()) @ looked_at
        slope = -(uphill * q).imag
        pace = 0.9 * pace + 0.03 * slope / np.sqrt((slope**2).mean(axis=1, keepdims=True))
        phase += pace

    def hidden(phase):
        told = drive(phase)
        true = sound_level(np.abs((told.q * wanted).sum(axis=1)))
        return true - exposure(told, alone(EAR)).level[:, 0]

    assert hidden(phase).max() > hidden(at_first).max() + 0.5  # The search does search.
    assert hidden(phase).max() < MISSED


def test_what_modes_leave_out_is_put_on():
    """The field by modes at its points is the field of the transfer matrix, within what it says that it leaves out."""
    search, points = cube_search(EAR, ARRAY, Acoustics()), cone_points(EAR, ARRAY, Acoustics())
    assert search.modes is not None
    assert search.points == len(points)
    true = transfer_matrix(points, ARRAY)
    parts = (search.modes @ search.field).astype(float)
    made = parts[: ARRAY.count, : len(points)].T + 1j * parts[: ARRAY.count, len(points) :].T
    most = np.abs(true).sum(axis=1).max()
    assert np.abs(made - true).sum(axis=1).max() < 1.3 * search.left_out
    assert search.left_out < 3e-3 * most


def test_no_more_than_all_transducers_in_step():
    search = cube_search(EAR, ARRAY, Acoustics())
    told = drive(focus_phase(ARRAY, np.array(EAR.position))[None])
    most = np.abs(transfer_matrix(EAR.points, ARRAY)).max(axis=0).sum()
    np.testing.assert_allclose(search.ceiling.sum(), most)
    assert exposure(told, alone(EAR)).peak[0] <= sound_level(np.array(most)) + 1e-9


def test_turns_of_a_phase_change_nothing():
    rng = np.random.default_rng(4)
    phase = rng.uniform(0, 2 * np.pi, (5, ARRAY.count))
    turns = 2 * np.pi * rng.integers(-(10**7), 10**7, phase.shape)
    one, many = (exposure(drive(each), PROFILE).level for each in (phase, phase + turns))
    np.testing.assert_allclose(many, one, atol=1e-3)


def test_places_that_only_advise_are_looked_at_in_27_points():
    place = small(reach=0.025, enforced=False)
    told = drive(np.random.default_rng(5).uniform(0, 6, (300, ARRAY.count)))
    true = sound_level(np.abs(told.q @ transfer_matrix(place.points, ARRAY).T).max(axis=1))
    np.testing.assert_allclose(exposure(told, alone(place)).level[:, 0], true, atol=1e-3)


@pytest.mark.parametrize(
    ("array", "acoustics"),
    [
        (TransducerArray.autd3(columns=1, rows=1), Acoustics()),
        (ARRAY, Acoustics(medium=Medium.at(temperature=30.0))),
        (ARRAY, Acoustics(directivity="piston")),
        (TransducerArray(position=np.zeros((1, 3)), normal=np.array([[0.0, 0.0, 1.0]])), Acoustics()),
    ],
)
def test_other_arrays_and_airs(array, acoustics):
    place, rng = small(), np.random.default_rng(6)
    told = drive(rng.uniform(0, 2 * np.pi, (40, array.count)), 0.7, array, acoustics)
    field = np.abs(told.q @ transfer_matrix(grid(place), array, acoustics=acoustics).T)
    missed = sound_level(field.max(axis=1)) - exposure(told, alone(place)).level[:, 0]
    assert missed.max() < MISSED
    assert np.median(missed) > -2 * ALLOWANCE


def test_arrays_of_the_same_numbers_share_a_search_and_others_do_not():
    again = TransducerArray.autd3()
    assert again is not ARRAY
    kept = cube_search(EAR, ARRAY, Acoustics())
    assert cube_search(EAR, again, Acoustics()) is kept
    for other in (
        replace(ARRAY, pressure=2 * ARRAY.pressure),
        replace(ARRAY, frequency=41e3),
        replace(ARRAY, position=ARRAY.position + 1e-4),
        replace(ARRAY, normal=-ARRAY.normal),
    ):
        assert cube_search(small(), other, Acoustics()) is not cube_search(small(), ARRAY, Acoustics())


def test_silence_is_silent():
    assert exposure(drive(np.zeros((3, ARRAY.count)), 0.0), PROFILE).peak == pytest.approx(-40)
