from dataclasses import replace

import numpy as np
import pytest
from tests.solvers.conftest import TEN, random_matrix

from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.solvers import Fast, Problem, error_of, solve
from midair.solvers.problem import CellTarget


def test_no_worse_than_the_papers_method(transfer, patterns_to_points, psi):
    """Of the plain form of the paper's method on the same ten patterns in 50 iterations."""
    for strength, mean, worst in ((0.1, 0.0527, 0.0737), (0.2, 0.1609, 0.2612)):
        problem = Problem(G=transfer, amplitude=strength * patterns_to_points(TEN), psi=psi)
        error = error_of(problem, Fast().solve(problem).phase)
        assert error.mean() <= mean, strength
        assert error.max() <= worst, strength


@pytest.mark.long
def test_single_and_double_precision_reach_the_same_error(transfer, patterns_to_points, psi):
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points(TEN[:4]), psi=psi)
    single, double = (error_of(problem, Fast(precision=p).solve(problem).phase) for p in ("single", "double"))
    np.testing.assert_allclose(single, double, atol=0.002)


def test_frames_do_not_depend_on_their_batch(transfer, patterns_to_points):
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points(TEN[:3]))
    one, three = (
        Fast(batch=batch, field_iterations=10, iterations=5, more_iterations=0, precision="double") for batch in (1, 3)
    )
    np.testing.assert_allclose(one.solve(problem).phase, three.solve(problem).phase, atol=1e-6)


def small(seed=0, frames=6, **rest):
    amplitude = np.random.default_rng(seed).uniform(0, 0.2, (frames, 8))
    return Problem(G=random_matrix(8, 24, seed), amplitude=amplitude, **rest)


def change_of(phase):
    return np.abs(np.exp(1j * phase[1:]) - np.exp(1j * phase[:-1])) ** 2


def test_smooth_phases_change_less_and_the_sum_is_less():
    """E^2 / 2 + mu mean(1 - cos) over all frames is at most that of independent frames."""
    rng, mu = np.random.default_rng(3), 0.01
    path = 0.1 + 0.05 * np.sin(0.1 * np.arange(20)[:, None] + rng.uniform(0, 6, 8))
    alone = replace(small(frames=20), amplitude=path)
    cost, jumps = [], []
    for problem in (alone, replace(alone, smooth=mu)):
        phase = Fast(precision="double").solve(problem).phase
        jumps.append(change_of(phase).mean())
        cost.append((error_of(problem, phase) ** 2).sum() / 2 + mu * (change_of(phase) / 2).mean(axis=1).sum())
    assert jumps[1] < 0.3 * jumps[0]
    assert cost[1] < cost[0]


def test_smooth_goes_on_from_one_batch_to_the_next_and_does_not_freeze_a_faint_frame():
    """The first frame of a batch is coupled to the last of the previous one: the same target, the same phases."""
    problem = replace(small(frames=1), smooth=1.0)
    problem = replace(problem, amplitude=np.repeat(problem.amplitude, 6, axis=0))
    tied = Fast(batch=2, precision="double").solve(problem).phase
    assert change_of(tied).max() < 1e-3
    problem = replace(small(frames=3), smooth=1e-3)
    problem = replace(problem, amplitude=problem.amplitude * np.array([[1], [1e-3], [1]]))
    phase = Fast(precision="double").solve(problem).phase
    assert error_of(problem, phase).max() < 0.2


def test_cells_are_met_where_points_are_too_many_to_be_met():
    amplitude, weights = np.random.default_rng(6).uniform(0.3, 0.5, (3, 32)), np.kron(np.eye(4), np.full(8, 0.125))
    problem = Problem(G=random_matrix(32, 12, 6), amplitude=amplitude)
    fitted = replace(problem, cells=CellTarget(weights=weights, wanted=problem.amplitude**2 @ weights.T))
    by_points, by_cells = (error_of(fitted, Fast().solve(one).phase).max() for one in (problem, fitted))
    assert by_cells < 1e-3
    assert by_points > 0.01


def test_the_progress_ends_at_the_end_also_behind_silence():
    amplitude = np.zeros((9, 4))
    amplitude[1:6] = 300.0
    target = AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=ControlGrid(rows=2, columns=2, pitch=20e-3))
    told = []
    for method in ("fast", "glide"):
        solve(target, TransducerArray.autd3(), method=method, progress=lambda *done: told.append(done))
        assert told[-1] == (9, 9), method
        told.clear()
