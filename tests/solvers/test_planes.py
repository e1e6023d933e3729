import numpy as np
import pytest
from scipy.spatial.distance import pdist

from midair.model import Acoustics, ControlGrid, Drive, Medium, TransducerArray
from midair.physics import propagate, relative_error
from midair.solvers import multi_plane_problem, place_grid, solver
from midair.solvers.phases import spreading_phase
from midair.solvers.planes import converging_phase

SMALL = ControlGrid(rows=6, columns=5)
LEFT, RIGHT = (-0.05, 0.0, 0.15), (0.05, 0.0, 0.2)


@pytest.fixture(scope="module")
def hands():
    return [
        place_grid(SMALL, centre=LEFT, normal=(0.34, 0.0, 0.94)),
        place_grid(SMALL, centre=RIGHT, normal=(-0.34, 0.1, 1.0)),
    ]


def test_a_grid_that_is_placed_keeps_its_distances_and_looks_along_its_normal():
    np.testing.assert_allclose(place_grid(SMALL, centre=(0, 0, 0.2), normal=(0, 0, 3.0)), SMALL.position, atol=1e-15)
    for normal in ((0.3, 0.0, 1.0), (0.0, -2.0, 0.1), (0.1, 0.2, -0.9)):
        points = place_grid(SMALL, centre=LEFT, normal=normal)
        assert np.abs((points - LEFT) @ normal).max() < 1e-15, normal
        np.testing.assert_allclose(pdist(points), pdist(SMALL.position), atol=1e-15, err_msg=str(normal))
        along_row, along_column = points[1] - points[0], points[SMALL.columns] - points[0]
        assert np.cross(along_row, along_column) @ normal > 0, normal


def test_one_level_plane_has_the_spreading_phase_and_one_wider_than_the_array_a_plane_wave():
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 12), np.linspace(-0.05, 0.05, 12))
    square = np.stack([x.ravel(), y.ravel(), np.zeros(144)], axis=1)
    array = TransducerArray(position=square, normal=np.broadcast_to([0.0, 0.0, 1.0], square.shape))
    grid, air = ControlGrid(rows=7, columns=7, pitch=2e-3), Medium()
    here, flat = converging_phase(grid.position, array, air), spreading_phase(grid, array, air)
    # The spreading phase is the first-order term; its error for a narrow array, in rad.
    assert np.ptp(here - flat) < 0.05 < 0.5 < np.ptp(flat)
    few = TransducerArray(position=np.eye(3) * [0.01, 0.01, 0], normal=np.broadcast_to([0.0, 0.0, 1.0], (3, 3)))
    phase = converging_phase(ControlGrid(centre=(0.01 / 3, 0.01 / 3)).position, few, Medium())
    assert np.ptp(phase) < 1e-9


def test_two_hands_are_solved_as_one_and_heard_as_solved(array, hands):
    acoustics = Acoustics(medium=Medium(attenuation=0), directivity="point")
    rng = np.random.default_rng(5)
    wanted = np.kron(rng.uniform(200, 1000, (4, 6)), np.ones(10))
    problem = multi_plane_problem(hands, wanted, array, acoustics=acoustics)
    theta = solver("fast").solve(problem).phase
    drive = Drive(phase=theta, level=np.ones(4), rate=1000.0, array=array, acoustics=acoustics)
    # From the drive's propagated field in Pa, plane by plane, independent of the problem.
    heard = np.concatenate([np.abs(propagate(drive, plane)) for plane in hands], axis=1)
    error = relative_error(heard, wanted)
    asleep = relative_error(np.roll(heard, 1, axis=0), wanted)
    assert error.max() < 0.15 < asleep.min()
