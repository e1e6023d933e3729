"""The paper's array above the paper's grid, in units of the strongest focus, and targets for it."""

import numpy as np
import pytest

from midair.model import Acoustics, ControlGrid, Medium, SensorGrid, TransducerArray
from midair.physics import transfer_matrix
from midair.solvers import one_blas_thread
from midair.solvers.backend import LIBRARIES
from midair.solvers.phases import spreading_phase
from midair.targets import interpolation_matrix


@pytest.fixture(scope="session", autouse=True)
def _one_thread():
    with one_blas_thread():
        yield


@pytest.fixture(scope="session")
def array():
    return TransducerArray.autd3()


@pytest.fixture(scope="session")
def lossless():
    return Medium(attenuation=0)


@pytest.fixture(scope="session")
def transfer(array, lossless):
    matrix = transfer_matrix(ControlGrid(), array, acoustics=Acoustics(medium=lossless, directivity="point"))
    return matrix / np.abs(matrix).sum(axis=1).max()


@pytest.fixture(scope="session")
def psi(array, lossless):
    """Phases at the points with which a solver begins."""
    return spreading_phase(ControlGrid(), array, lossless)


@pytest.fixture(scope="session")
def channels_to_points():
    """(frame, channel) of 0 to 1 -> (frame, point) of the same scale."""
    weights = interpolation_matrix(SensorGrid(), ControlGrid())
    return lambda channels: np.asarray(channels, float) @ weights.T


TEN = (0x0001, 0x8001, 0x0660, 0xF99F, 0x5A5A, 0x1248, 0xFFFF, 0x00FF, 0x8421, 0x3C18)
"""Patterns whose bit k is channel k, for a comparison with the paper's method."""


@pytest.fixture(scope="session")
def patterns_to_points(channels_to_points):
    """Integers whose bit k is channel k -> (frame, point)."""
    return lambda patterns: channels_to_points([[(bits >> k) & 1 for k in range(16)] for bits in patterns])


def random_matrix(points, transducers, seed=0):
    """A random transfer matrix whose rows have a strongest field of about one."""
    rng = np.random.default_rng(seed)
    return (rng.normal(size=(points, transducers)) + 1j * rng.normal(size=(points, transducers))) / transducers


@pytest.fixture
def random_problem():
    """G, p and x of a small problem drawn with a seed: (points, transducers, seed) -> (G, p, x)."""

    def draw(points, transducers, seed):
        rng = np.random.default_rng(seed)
        G = (rng.normal(size=(points, transducers)) + 1j * rng.normal(size=(points, transducers))) / transducers
        return G, rng.uniform(0, 0.3, points), rng.uniform(-np.pi, np.pi, transducers + points)

    return draw


NEEDS = {"numpy": (), "strict": ("array_api_strict",), "torch": ("torch", "array_api_compat"), "cupy": ("cupy",)}


@pytest.fixture(params=list(LIBRARIES), ids=str)
def library(request):
    """Name of each array library that is installed."""
    for needed in NEEDS[request.param]:
        pytest.importorskip(needed)
    return request.param


@pytest.fixture(scope="session")
def complex_slope():
    """(cost, y) -> the slope s with d cost = Re(conj(s) dy), by central differences, row by row."""

    def of(cost, y, h=1e-6):
        slope = np.zeros_like(y)
        for n in range(y.shape[1]):
            for along in (1, 1j):
                step = np.zeros_like(y)
                step[:, n] = h * along
                slope[:, n] += along * (cost(y + step) - cost(y - step)) / (2 * h)
        return slope

    return of
