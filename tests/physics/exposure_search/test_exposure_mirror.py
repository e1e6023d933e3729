from dataclasses import replace

import numpy as np
import pytest

from midair.files import profile_named
from midair.model import Acoustics, Drive, TransducerArray
from midair.physics import ExposureProfile, Place, exposure, searched_points, sound_level, transfer_matrix
from midair.physics.exposure_search.exposure_mirror import Halves, mirrored, pair_of
from midair.physics.exposure_search.exposure_products import Product, Workspace
from midair.physics.exposure_search.exposure_search import ALLOWANCE, searches_of

ARRAY = TransducerArray.autd3()
PROFILE = profile_named("occupational-110")


def ears(reach=8e-3, *, shift=0.0, **options):
    """Two small cubes where ears are; both left of the middle of the array by half of what they are shifted."""
    at = [(-75e-3 - shift, -0.35, 0.45), (75e-3, -0.35, 0.45)]
    return tuple(
        Place(name=name, position=here, reach=reach, limit=110.0, **options)
        for name, here in zip(("left ear", "right ear"), at, strict=True)
    )


def profile(*places):
    return ExposureProfile(name="p", title="t", source="s", evidence="e", places=places)


def drive(array, frames=40, seed=0, *, own=True):
    rng = np.random.default_rng(seed)
    level = rng.random((frames, array.count)) if own else rng.random(frames)
    return Drive(phase=rng.uniform(-9, 9, (frames, array.count)), level=level, rate=1000.0, array=array)


def test_all_of_the_units_but_four_have_an_image_and_images_are_each_others():
    pair = pair_of(PROFILE.places, ARRAY)
    assert pair.numbers == (0, 1)
    assert pair.array.count == ARRAY.count + 4
    image = mirrored(pair.array.position, pair.middle)
    np.testing.assert_allclose(pair.array.position[pair.partner], image, atol=1e-9)
    assert (pair.partner[pair.partner] == np.arange(pair.array.count)).all()


def test_the_box_holds_one_ear_and_the_image_of_the_other():
    pair = pair_of(PROFILE.places, ARRAY)
    left, right = (np.array(place.position) for place in PROFILE.places[:2])
    for middle in (left, mirrored(right, pair.middle)):
        corner = np.abs(middle - pair.box.position).max() + PROFILE.places[0].reach
        assert corner <= pair.box.reach + 1e-12
    # The search extends at most a third of a millimetre beyond a cube.
    assert pair.box.reach - PROFILE.places[0].reach < 3e-4


@pytest.mark.parametrize("own", [True, False], ids=["a level each", "a level a frame"])
def test_a_pair_is_heard_as_the_field_at_its_points(own):
    places = ears(shift=2e-4)
    told = drive(ARRAY, own=own)
    found = exposure(told, profile(*places)).level
    left_out = [each.left_out for each in searches_of(places, ARRAY, (Acoustics(),)).each]
    for number, place in enumerate(places):
        points = searched_points(place, ARRAY, (Acoustics(),), among=places)
        loudest = np.abs(told.q @ transfer_matrix(points, ARRAY).T).max(axis=1)
        strongest = told.level.max(axis=1) if own else told.level
        least = sound_level(10 ** (ALLOWANCE / 20) * loudest)
        assert (found[:, number] > least - 1e-3).all()
        assert (
            found[:, number] < sound_level(10 ** (ALLOWANCE / 20) * loudest + 3 * strongest * left_out[number])
        ).all()


def test_the_order_of_places_and_a_third_one_between_change_nothing():
    left, right = ears()
    other = Place(name="other", position=(0.3, 0.1, 0.5), reach=8e-3, limit=110.0)
    told = drive(ARRAY, frames=8)
    one = exposure(told, profile(left, right, other)).level
    turned = exposure(told, profile(other, right, left)).level
    np.testing.assert_allclose(turned[:, [2, 1, 0]], one, atol=0.1)
    np.testing.assert_allclose(turned[:, 0], exposure(told, profile(other)).level[:, 0], atol=1e-3)


MEASURED = replace(ARRAY, response=np.full(ARRAY.count, 0.9 + 0j))
TURNED = replace(ARRAY, position=ARRAY.position @ np.array([[0.9, 0.1, 0], [-0.1, 0.9, 0], [0, 0, 1]]))


@pytest.mark.parametrize(
    ("places", "array"),
    [
        (ears()[:1], ARRAY),
        (ears(enforced=False), ARRAY),
        (ears(reach=0.0), ARRAY),
        (ears(shift=1.6e-3), ARRAY),
        ((ears()[0], ears(9e-3)[1]), ARRAY),
        (ears(), MEASURED),
        (ears(), TURNED),
        (ears(), replace(ARRAY, normal=np.array([[0.6, 0.0, 0.8]] * ARRAY.count))),
        (ears(), replace(ARRAY, position=np.repeat(ARRAY.position[::2], 2, axis=0))),
    ],
    ids=["one", "advice", "points", "elsewhere", "larger", "measured", "turned", "tilted", "two at a place"],
)
def test_places_without_a_mirror_image_are_no_pair(places, array):
    assert pair_of(places, array) is None


def test_halves_are_the_modes_of_both_whatever_has_an_image():
    """Five transducers: 0 and 3 are images, 1 is its own, 2 and 4 have none but at 5 and 6."""
    partner = np.array([3, 1, 5, 0, 6, 2, 4])
    rng = np.random.default_rng(0)
    modes = (rng.standard_normal((3, 7)) + 1j * rng.standard_normal((3, 7))).astype(np.complex64)
    halves = Halves.of(modes, partner, 5)
    assert sorted(halves.order) == list(range(5))
    q = (rng.standard_normal((6, 5)) + 1j * rng.standard_normal((6, 5))).astype(np.complex64)
    told = q[:, halves.order]
    both = np.empty((2, 3, 6, 3), np.float32)
    halves.into(both[0], both[1], np.stack([told.real, told.imag, told.real + told.imag]), Workspace())
    for found, own in zip(both, (modes[:, :5], modes[:, partner[:5]]), strict=True):
        true = q @ own.T
        np.testing.assert_allclose(found, [true.real, true.imag, true.real + true.imag], atol=1e-5)
    assert isinstance(halves.common, Product)
