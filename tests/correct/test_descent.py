import numpy as np
import pytest

from midair.correct.envelope_prediction import descend

CURVES = np.array([1.0, 3.0, 10.0, 40.0], np.float32)
LEAST = np.array([0.3, -0.2, 0.5, 0.1], np.float32)


def bowl(x):
    """A quadratic with its least at `LEAST`, known in closed form."""
    return float((CURVES * (x - LEAST) ** 2).sum() / 2), CURVES * (x - LEAST)


def found(iterations, scale=1.0, function=bowl):
    spread = np.broadcast_to(np.asarray(scale, np.float32), (4,))
    return descend(function, np.zeros(4, np.float32), scale=spread, first=1e-3, iterations=iterations, memory=4)


def test_the_least_of_a_quadratic():
    np.testing.assert_allclose(found(20), LEAST, atol=1e-3)


def test_one_step_where_the_scale_is_the_inverse_curvature():
    np.testing.assert_allclose(found(1, 1 / CURVES), LEAST, atol=1e-3)


def test_no_step_makes_it_worse():
    """A narrow valley that bends (Rosenbrock's), in which full steps fail."""

    def valley(x):
        a, b = float(x[0]), float(x[1])
        slope = np.array([-2 * (1 - a) - 400 * a * (b - a * a), 200 * (b - a * a), 0, 0], np.float32)
        return (1 - a) ** 2 + 100 * (b - a * a) ** 2, slope

    costs = [valley(found(number, function=valley))[0] for number in (0, 2, 5, 10, 40)]
    assert (np.diff(costs) <= 1e-6).all()
    assert costs[0] == 1
    assert costs[-1] < 0.3


@pytest.mark.parametrize("iterations", [0, 5])
def test_where_nothing_slopes_it_stays(iterations):
    there = descend(bowl, LEAST, scale=CURVES, first=1e-3, iterations=iterations, memory=4)
    np.testing.assert_array_equal(there, LEAST)
