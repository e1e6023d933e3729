import numpy as np
import pytest

from midair.calibration.measure.frequency_response import (
    band_sums,
    bend_uncertainty,
    distinct,
    fit_levels,
    predicted_share,
    same_levels,
    solve_sums,
)


def levels(x, y, noise=0.0):
    x, y = (np.reshape(np.asarray(values, float), (-1, 1, 1)) for values in (x, y))
    return fit_levels(x, y, np.full(x.shape, noise))


def test_a_line_and_a_parabola_at_hand_computed_numbers():
    x = np.array([1.0, 2, 3, 4, 5])
    line = levels(x, 0.5 + 2 * x)
    assert (line.gain[0, 0], line.intercept[0, 0]) == (pytest.approx(2), pytest.approx(0.5))
    assert line.curvature[0, 0] == pytest.approx(0, abs=1e-9)
    # y = x - .01 x^2: the line's slope is 1 - .06, the parabola's falls by .08 over 1 to 5
    bent = levels(x, x - 0.01 * x**2)
    assert bent.gain[0, 0] == pytest.approx(0.94)
    assert bent.curvature[0, 0] == pytest.approx(-0.08 / 0.94)
    # Known noise is a lower bound of the errors.
    line = levels(x, 2 * x, noise=0.1)
    # .1 / sqrt(sum (x - 3)^2) = .1 / sqrt(10)
    assert line.gain_uncertainty[0, 0] == pytest.approx(0.1 / np.sqrt(10))
    assert line.intercept_uncertainty[0, 0] == pytest.approx(0.1 * np.sqrt(1 / 5 + 9 / 10))


def test_lines_through_noise_scatter_as_stated():
    rng = np.random.default_rng(3)
    x = np.broadcast_to(np.array([1.0, 2, 4, 8, 16]).reshape(5, 1, 1), (5, 1, 4000))
    y = x + 0.05 * rng.standard_normal(x.shape)
    line = fit_levels(x, y, np.zeros(x.shape))
    for value, unsure in (
        (line.gain - 1, line.gain_uncertainty),
        (line.intercept, line.intercept_uncertainty),
        (line.curvature, line.curvature_uncertainty),
    ):
        # with Student's t, k = 2 covers 95.3 % for 3 degrees of freedom, 95.3 % for 2
        assert (np.abs(value) < 2 * unsure).mean() == pytest.approx(0.953, abs=0.012)


def test_takes_are_selected_for_levels_that_differ():
    assert distinct(np.array([3.0, 1.0, 1.02, 2.0, 3.1])).tolist() == [1.0, 2.0, 3.0]
    # five on all cells, in any order
    assert same_levels(np.array([5.0, 1, 2, 3, 4]), [None] * 5, 2).T.tolist() == [[1, 2, 3, 4, 0]] * 2
    # or five on each cell alone
    cells = [0] * 5 + [1] * 5
    found = same_levels(np.array([1.0, 2, 3, 4, 5, 5, 4, 3, 2, 1]), cells, 2)
    assert found.T.tolist() == [[0, 1, 2, 3, 4], [9, 8, 7, 6, 5]]
    assert same_levels(np.arange(1.0, 5), [None] * 4, 2) is None
    assert same_levels(np.arange(1.0, 10), cells[:9], 2) is None


def test_share_of_the_predicted_output_whose_nonlinearity_is_a_uniform_distribution():
    share = np.array([[1.06, 1.0], [1.03, 1.0], [1.0, 1.001]])
    assert bend_uncertainty(share, np.full(share.shape, 0.001)) == pytest.approx([0.058 / np.sqrt(3), 0])
    rng = np.random.default_rng(5)
    x = rng.standard_normal((20_000, 1))
    noise = 0.05 * rng.standard_normal((20_000, 2))
    whole = band_sums(x, x * np.array([1.0, 2.0]) + noise, 1000.0, resolution=5.0, width=10.0)
    weak = band_sums(x, x * np.array([0.9, 2.0]) + noise, 1000.0, resolution=5.0, width=10.0)
    counts = np.ones(len(whole.frequency), bool)
    share, error = predicted_share(weak, solve_sums([whole]), counts)
    assert share == pytest.approx([0.9, 1.0], abs=0.002)
    assert (error < 0.002).all()
    # a channel without response has no share
    deaf = band_sums(x, np.zeros((20_000, 2)), 1000.0, resolution=5.0, width=10.0)
    share, error = predicted_share(deaf, solve_sums([deaf]), counts)
    assert (share.tolist(), error.tolist()) == ([0, 0], [1, 1])
