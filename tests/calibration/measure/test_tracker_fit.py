import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from midair.calibration import fit_tracker
from midair.errors import InputError
from midair.rig.correction.laboratory import FOLLOWED

PLACES = np.array([[-0.05, -0.04, 0.18], [0.05, -0.04, 0.22], [0.05, 0.04, 0.18], [-0.05, 0.04, 0.22]])
TURN = Rotation.from_euler("xyz", [20, -10, 160], degrees=True).as_matrix()
OFFSET = np.array([0.02, -0.15, 0.03])


def held(places, scatter=0.0, rng=None):
    noise = 0 if rng is None else rng.normal(0, scatter, places.shape)
    return (places - OFFSET) @ TURN + noise


def test_exact_places_give_the_placement_and_twice_the_uncertainty_covers_the_error_of_others():
    for count in (3, 4):
        found = fit_tracker(held(PLACES[:count]), PLACES[:count])
        np.testing.assert_allclose(found.rotation, TURN, atol=1e-9, err_msg=str(count))
        np.testing.assert_allclose(found.offset, OFFSET, atol=1e-9, err_msg=str(count))
        assert found.uncertainty < 1e-9, count
        rng, scatter, errors, covered = np.random.default_rng(5), 2e-3, [], []
        for _ in range(400):
            found = fit_tracker(held(PLACES[:count], scatter, rng), PLACES[:count])
            error = found.points(held(PLACES[:count])) - PLACES[:count]
            errors.append(error)
            covered.append(np.abs(error) < 2 * found.uncertainty)
        assert np.std(errors) == pytest.approx(scatter * np.sqrt(2 / count), rel=0.1), count
        assert 0.93 < np.mean(covered) < 0.99, count


def test_too_few_and_collinear_places_and_those_in_another_order_are_refused():
    for places, told in (
        (PLACES[:2], "3 places or more"),
        (np.outer([0, 1, 2, 3], [0.03, 0.02, 0.01]), "not in one line"),
        (PLACES * [1, 0.1, 0.1], "not in one line"),
    ):
        with pytest.raises(InputError, match=told):
            fit_tracker(held(places), places)
    with pytest.raises(InputError, match="scatter by"):
        fit_tracker(held(PLACES[[1, 0, 2, 3]]), PLACES)


def test_a_followed_palm_is_known_as_well_as_places_felt_within_5_mm():
    """The palm is over the middle of the array; the budget's numbers are from the same simulation."""
    rng, middle, off = np.random.default_rng(3), held(np.array([[0, 0, 0.2]])), []
    for _ in range(2000):
        found = fit_tracker(held(PLACES, 5e-3, rng), PLACES)
        turned = Rotation.from_matrix(found.rotation @ TURN.T).as_euler("xyz", degrees=True)
        off.append([*(1e3 * (found.points(middle)[0] - [0, 0, 0.2])), *turned])
    x, y, z, *tilt, turn = np.sqrt(np.square(off).mean(axis=0))
    expected = [FOLLOWED[name] for name in ("palm_aside_mm", "palm_height_mm", "palm_tilt_deg", "palm_turn_deg")]
    np.testing.assert_allclose(
        [np.hypot(x, y) / np.sqrt(2), z, np.hypot(*tilt) / np.sqrt(2), turn], expected, rtol=0.05
    )
