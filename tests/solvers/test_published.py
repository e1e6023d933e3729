import numpy as np
from benchmarks.published import PUBLISHED, GerchbergSaxton, Naive, WeightedGerchbergSaxton
from tests.solvers.conftest import random_matrix

from midair.solvers import Problem, error_of


def test_one_point_is_a_focus():
    """All transducers in phase at the point: theta = -arg G, for any method."""
    G = random_matrix(1, 12)
    for method in (Naive(), GerchbergSaxton(), WeightedGerchbergSaxton()):
        theta = method.solve(Problem(G=G, amplitude=np.array([[0.1]]))).phase[0]
        together = np.exp(1j * (theta + np.angle(G[0])))
        np.testing.assert_allclose(together / together[0], 1, atol=1e-10, err_msg=str(method))


def test_dense_patterns_are_missed_by_as_much_as_the_peers_miss_them(transfer, patterns_to_points):
    """Independent implementations on the same kind of patterns: GS .39, greedy .34."""
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points([0xF99F, 0x5A5A, 0x00FF]))
    for name, low, high in (("gs", 0.3, 0.45), ("greedy", 0.15, 0.35)):
        answer = PUBLISHED[name]().solve(problem)
        assert low < error_of(problem, answer.phase, answer.level).mean() < high, name
