import numpy as np
import pytest
from benchmarks.published import PUBLISHED, GerchbergSaxton, Naive, WeightedGerchbergSaxton

from midair.solvers import Problem, error_of


def random_matrix(points, transducers, seed=0):
    rng = np.random.default_rng(seed)
    return (rng.normal(size=(points, transducers)) + 1j * rng.normal(size=(points, transducers))) / transducers


@pytest.mark.parametrize("method", [Naive(), GerchbergSaxton(), WeightedGerchbergSaxton()], ids=str)
def test_one_point_is_a_focus(method):
    """All transducers in phase at the point: theta = -arg G, for any method."""
    G = random_matrix(1, 12)
    theta = method.solve(Problem(G=G, amplitude=np.array([[0.1]]))).phase[0]
    together = np.exp(1j * (theta + np.angle(G[0])))
    np.testing.assert_allclose(together / together[0], 1, atol=1e-10)


@pytest.mark.parametrize(("name", "low", "high"), [("gs", 0.3, 0.45), ("greedy", 0.15, 0.35)])
def test_dense_patterns_are_missed_by_as_much_as_the_peers_miss_them(transfer, patterns_to_points, name, low, high):
    """Independent implementations on the same kind of patterns: GS .39, greedy .34."""
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points([0xF99F, 0x5A5A, 0x00FF]))
    answer = PUBLISHED[name]().solve(problem)
    assert low < error_of(problem, answer.phase, answer.level).mean() < high
