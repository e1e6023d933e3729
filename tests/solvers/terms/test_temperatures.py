import numpy as np
import pytest

from midair.model import Acoustics, ControlGrid, Medium, TransducerArray
from midair.physics import transfer_matrix
from midair.solvers.terms.temperatures import airs_around, psi_at_temperatures

ROOM = Acoustics(medium=Medium.at(temperature=22.0, humidity=0.3), directivity="point")


def test_the_airs_reach_both_ends_in_steps_of_two_degrees_at_most():
    """Stated constants get faster and slower."""
    expected = {0.0: [], 1.0: [-1, 1], 2.0: [-2, 2], 3.0: [-3, -1.5, 1.5, 3], 4.0: [-4, -2, 2, 4]}
    for robust, others in expected.items():
        airs = airs_around(ROOM, robust)
        assert airs[0] == ROOM, robust
        assert [each.medium.temperature - 22.0 for each in airs[1:]] == pytest.approx(others), robust
        assert {(each.directivity, each.medium.humidity) for each in airs} == {("point", 0.3)}, robust
    _, colder, warmer = airs_around(Acoustics(), 2.0)
    assert colder.medium.speed < 339 < 341 < warmer.medium.speed


def test_one_drive_makes_all_fields_that_a_solver_begins_with():
    """With the drive that focuses on one point, the phase there is that of a path: k r of each air, from the same r."""
    array, grid = TransducerArray.autd3(columns=1, rows=1), ControlGrid(rows=1, columns=1)
    G = [transfer_matrix(grid, array, acoustics=air) for air in airs_around(ROOM, 2.0)]
    own, colder, warmer = psi_at_temperatures(G, np.array([0.7]))
    assert own == 0.7
    # 745 rad/m at 22 degrees, .17 % less for each degree, over 210 mm or a little more.
    assert np.angle(np.exp(1j * (colder - own))) == pytest.approx(0.55, abs=0.03)
    assert np.angle(np.exp(1j * (warmer - own))) == pytest.approx(-0.55, abs=0.03)
