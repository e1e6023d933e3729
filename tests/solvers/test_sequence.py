import numpy as np
import pytest

from midair.model import SensorGrid
from midair.solvers import LevenbergMarquardt, Problem, error_of
from midair.solvers.levenberg_marquardt import FrameAnswer, solve_in_turn


def moving_blob(frames, rate=1000.0):
    """A Gaussian of 11 mm that moves at .25 m/s, its pressure modulated at 100 Hz: channel amplitudes, (frame, 16)."""
    time, sensor = np.arange(frames) / rate, SensorGrid()
    x = 0.25 * time - 0.011
    X, Y = np.meshgrid(sensor.x, sensor.y)
    shape = np.exp(-((X - x[:, None, None]) ** 2 + (Y - 0.3 * x[:, None, None]) ** 2) / (2 * 0.011**2))
    pressure = np.maximum(np.sin(2 * np.pi * 100 * time + 0.3), 0)
    return (shape * np.sqrt(pressure)[:, None, None]).reshape(frames, 16)


def counting(G, amplitude):
    """A frame solver that adds one to every unknown and records its arguments."""
    problem, calls = Problem(G=G, amplitude=amplitude), []

    def one(p, x, iterations):
        calls.append((x[0], iterations))
        return FrameAnswer(x=x + 1, iterations=iterations, status="iterations")

    return problem, one, calls


G = np.ones((2, 3), complex)
SOUND = np.array([[0, 0], [1, 0], [0, 0], [1, 1]], float)


def test_previous_goes_on_through_silence():
    problem, one, calls = counting(G, SOUND)
    answer = solve_in_turn(problem, one, iterations=(9, 4), start="previous")
    assert calls == [(0.0, 9), (1.0, 4)]
    assert answer.status == ("silent", "iterations", "silent", "iterations")
    np.testing.assert_array_equal(answer.phase[:, 0], [0, 1, 1, 2])
    np.testing.assert_array_equal(answer.iterations, [0, 9, 0, 4])


def test_zero_makes_frames_independent():
    problem, one, calls = counting(G, SOUND)
    solve_in_turn(problem, one, iterations=(9, 4), start="zero")
    assert calls == [(0.0, 9), (0.0, 9)]


def test_progress_counts_every_frame():
    problem, one, _ = counting(G, SOUND)
    seen = []
    solve_in_turn(problem, one, iterations=(1, 1), start="zero", progress=lambda *now: seen.append(now))
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


@pytest.mark.slow
def test_moving_blob_is_followed_below_one_percent(transfer, channels_to_points):
    problem = Problem(G=transfer, amplitude=0.1 * channels_to_points(moving_blob(60)))
    answer = LevenbergMarquardt().solve(problem)
    error = error_of(problem, answer.phase)
    assert error[10:].max() < 0.01
    assert error[[status != "silent" for status in answer.status]].mean() < 0.01
