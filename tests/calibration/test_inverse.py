import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.calibration.conftest import one_channel

from midair.calibration import inverse_response, undo_matrix
from midair.dsp import band_window
from midair.model import Crosstalk
from midair.physics import SensorModel, calibration_of, channel_response

BAND, EDGES = (20.0, 470.0), (10.0, 23.5)
MODEL = SensorModel().with_spread(seed=5)


def test_inverse_at_hand_computed_numbers_and_silent_without_response():
    # H = 2j, eps = (0.1 / 0.05)^2 = 4: W = -2j / (4 + 4)
    calibration = one_channel(2j, 0.1)
    value = inverse_response(calibration, np.array([20.0, 100.0]), BAND, edges=EDGES, floor=0.05)
    assert value[:, 0, 0] == pytest.approx([-0.125j, -0.25j])
    frequency = np.linspace(0, 500, 11)
    assert not inverse_response(one_channel(0.0, 0.0), frequency, BAND, edges=EDGES).any()
    assert not inverse_response(one_channel(0.0, 1e-3), frequency, BAND, edges=EDGES).any()
    # a response of 0 only at 0 Hz, without noise, causes no division by zero
    assert np.isfinite(
        inverse_response(calibration_of(SensorModel(noise=0.0)), frequency, (0, 500), edges=(0, 0))
    ).all()


def test_inverse_times_response_is_the_band_window():
    frequency = np.linspace(0, 500, 1001)
    through = inverse_response(calibration_of(MODEL), frequency, BAND, edges=EDGES) * channel_response(MODEL, frequency)
    window = band_window(frequency, BAND, edges=EDGES)[:, None, None]
    # loss by regularisation: (noise-equivalent pressure / floor)^2, 1 mPa over 50 mPa squared, more at 20 Hz
    assert np.abs(through - window).max() < 2e-3
    assert 2e-4 < np.abs(through - window)[100:900].max() < 8e-4


def crosstalk(matrix):
    return Crosstalk(matrix=np.array(matrix, float), uncertainty=np.zeros(np.shape(matrix)))


def test_inverse_of_hand_computed_matrices():
    # [[1, .5], [0, 1]]: the part of the second cell is subtracted from the first
    assert undo_matrix(crosstalk([[1, 0.5], [0, 1]])) == pytest.approx(np.array([[1, -0.5], [0, 1]]))
    # a scalar-like case: C = [[1, c], [c, 1]], d: on the difference mode 1 - c, (1 - c + d^2) / ((1 - c)^2 + d^2)
    c, d = 0.5, 0.3
    undone = undo_matrix(crosstalk([[1, c], [c, 1]]), damping=d) @ [1, -1]
    assert undone == pytest.approx(np.array([1, -1]) * (1 - c + d**2) / ((1 - c) ** 2 + d**2))
    assert np.isfinite(undo_matrix(crosstalk(np.ones((2, 2))), damping=0.1)).all()


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.1))
def test_crosstalk_round_trip(seed, strength):
    rng = np.random.default_rng(seed)
    matrix = strength * rng.uniform(-1, 1, (6, 6))
    np.fill_diagonal(matrix, 1)
    pressure = rng.standard_normal((50, 6))
    felt = pressure @ matrix.T
    assert felt @ undo_matrix(crosstalk(matrix)).T == pytest.approx(pressure, abs=1e-9)
    # with strong damping the pressure is unchanged
    assert felt @ undo_matrix(crosstalk(matrix), damping=1e4).T == pytest.approx(felt, abs=1e-6)
