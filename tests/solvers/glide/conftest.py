import numpy as np
import pytest

from midair.datasets import stroke
from midair.model import ControlGrid, SensorGrid
from midair.solvers import Problem
from midair.targets import prepare


@pytest.fixture(scope="session")
def problem_of(transfer, array, psi):
    """(frame, point) of strengths -> Problem."""
    return lambda strength: Problem(G=transfer, amplitude=strength, psi=psi, position=array.position)


@pytest.fixture(scope="session")
def moving_spot(channels_to_points):
    """A Gaussian of 11 mm that moves back and forth, modulated at 100 Hz, at 1 kHz: frames -> (frame, point)."""

    def strengths(frames):
        time = np.arange(frames) / 1000
        centre = -0.011 * np.cos(0.25 / 0.011 * time)[:, None, None]
        X, Y = np.meshgrid(SensorGrid().x, SensorGrid().y)
        spot = np.exp(-((X - centre) ** 2 + (Y - 0.3 * centre) ** 2) / (2 * 0.011**2)).reshape(frames, 16)
        return 0.1 * channels_to_points(spot * (0.55 + 0.45 * np.sin(2 * np.pi * 100 * time + 0.3))[:, None])

    return strengths


@pytest.fixture(scope="session")
def towel():
    """Targets of a towel's stroke without nearly silent frames: frames -> (frame, point)."""
    amplitude = prepare(stroke("towel"), grid=ControlGrid()).amplitude
    amplitude = amplitude[amplitude.max(axis=1) > 0.01 * amplitude.max()]
    return lambda frames: 0.1 * amplitude[:frames] / amplitude.max()
