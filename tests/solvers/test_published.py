import numpy as np
import pytest
from benchmarks.published import PUBLISHED, GerchbergSaxton, Greedy, Naive, WeightedGerchbergSaxton, best_level

from midair.model import Acoustics
from midair.physics import focus_phase
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


def test_a_focus_of_the_array_is_the_focus_of_physics(array, lossless, transfer):
    """Control point 0 alone: the phases that focus on it."""
    from midair.model import ControlGrid

    theta = Naive().solve(Problem(G=transfer[:1], amplitude=np.array([[0.1]]))).phase[0]
    expected = focus_phase(array, ControlGrid().position[0], acoustics=Acoustics(medium=lossless))
    np.testing.assert_allclose(np.exp(1j * (theta - expected)), np.exp(1j * (theta - expected))[0], atol=1e-9)


def test_weights_make_equal_points_equal():
    """Two points with unequal coupling to the array: GS leaves them unequal, WGS does not."""
    G = random_matrix(2, 60) * np.array([[1], [0.4]])
    problem = Problem(G=G, amplitude=np.ones((1, 2)))
    sizes = {
        type(m).__name__: np.abs(problem.field(m.solve(problem).phase))[0]
        for m in (GerchbergSaxton(), WeightedGerchbergSaxton())
    }
    assert np.ptp(sizes["WeightedGerchbergSaxton"]) < 0.01 * sizes["WeightedGerchbergSaxton"].mean()
    assert np.ptp(sizes["GerchbergSaxton"]) > 0.1 * sizes["GerchbergSaxton"].mean()


def test_greedy_finds_the_best_of_all_phases_for_one_transducer():
    G = np.array([[1.0], [1j]])
    problem = Problem(G=G, amplitude=np.array([[1.0, 1.0]]))
    assert error_of(problem, Greedy().solve(problem).phase)[0] == pytest.approx(0)


def test_greedy_gets_better_with_more_rounds():
    problem = Problem(G=random_matrix(6, 40), amplitude=np.full((1, 6), 0.1))
    one, four = (error_of(problem, Greedy(iterations=n).solve(problem).phase)[0] for n in (1, 4))
    assert four < one


def test_best_level_is_the_least_squares_one():
    problem = Problem(G=random_matrix(5, 9), amplitude=np.full((1, 5), 0.05))
    theta = np.zeros((1, 9))
    level = best_level(problem, theta)
    around = [error_of(problem, theta, level + d)[0] for d in (-0.01, 0, 0.01)]
    assert np.argmin(around) == 1


@pytest.mark.parametrize(("name", "low", "high"), [("gs", 0.3, 0.45), ("greedy", 0.15, 0.35)])
def test_dense_patterns_are_missed_by_as_much_as_the_peers_miss_them(transfer, patterns_to_points, name, low, high):
    """Independent implementations on the same kind of patterns: GS .39, greedy .34."""
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points([0xF99F, 0x5A5A, 0x00FF]))
    answer = PUBLISHED[name]().solve(problem)
    assert low < error_of(problem, answer.phase, answer.level).mean() < high
