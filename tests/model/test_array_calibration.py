import numpy as np
import pytest

from midair.errors import InputError, MismatchError, NonFiniteError
from midair.model import ArrayCalibration, ControlGrid, TransducerArray
from midair.physics import focus_phase, transfer_matrix

ARRAY = TransducerArray.autd3(columns=1, rows=1)
RNG = np.random.default_rng(0)


def calibration(array=ARRAY, **changes):
    count = array.count
    values = {
        "array": array,
        "response": (1 + 0.1 * RNG.standard_normal(count)) * np.exp(0.1j * RNG.standard_normal(count)),
        "pole": np.full(count, -5000 + 1300j),
        "dead": np.arange(count) == 7,
        **{f"{name}_uncertainty": np.full(count, 0.01) for name in ("strength", "phase", "resonance", "quality")},
    }
    return ArrayCalibration(**values | changes)


def test_an_array_that_was_measured_is_solved_for_as_it_is():
    known = calibration()
    array = known.applied(ARRAY)
    grid = ControlGrid(rows=3, columns=3)
    np.testing.assert_array_equal(transfer_matrix(grid, array), transfer_matrix(grid, ARRAY) * known.response)
    np.testing.assert_array_equal(array.nominal.response, np.ones(ARRAY.count))
    assert array.same_as(ARRAY)
    assert (ARRAY.alike, array.alike) == (True, False)
    focus = transfer_matrix(np.array([[0, 0, 0.2]]), array) @ np.exp(1j * focus_phase(array, np.array([0, 0, 0.2])))
    assert np.abs(focus[0]) == pytest.approx(np.abs(transfer_matrix(np.array([[0, 0, 0.2]]), array)).sum())


def test_a_measured_array_has_poles_and_its_nominal_one_has_none():
    known = calibration()
    applied = known.applied(known.array)
    np.testing.assert_array_equal(applied.pole, known.pole)
    assert not applied.alike
    assert applied.nominal.alike
    assert len(applied.nominal.pole) == 0


def test_resonance_and_quality_are_those_of_the_pole():
    known = calibration(pole=np.full(ARRAY.count, -1 / 188e-6 - 2j * np.pi * 200))
    np.testing.assert_allclose(known.resonance, 39800)
    # omega tau / 2, as in `midair.physics.playback`.
    np.testing.assert_allclose(known.quality, 2 * np.pi * 39800 * 188e-6 / 2)


def test_belongs_to_one_array():
    with pytest.raises(MismatchError, match="measure this array"):
        calibration().applied(TransducerArray.autd3())


def test_what_was_measured_tells_files_apart():
    one, other = calibration(), calibration()
    assert one.identifier == calibration(response=one.response, pole=one.pole).identifier
    assert one.identifier != other.identifier
    assert "1 dead" in repr(one)


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"pole": np.full(ARRAY.count, 1.0 + 0j)}, InputError),
        ({"phase_uncertainty": np.full(ARRAY.count, -1.0)}, InputError),
        ({"response": np.full(ARRAY.count, np.nan)}, NonFiniteError),
        ({"response": np.ones(3)}, InputError),
        ({"level_uncertainty": -1.0}, InputError),
    ],
)
def test_refuses_what_no_array_can_be(wrong, error):
    with pytest.raises(error):
        calibration(**wrong)
