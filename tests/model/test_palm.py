import numpy as np
import pytest

from midair.model import Palm, PalmPath, TrackerPlacement


def test_a_disc_has_its_area_and_a_square_in_it_leaves_the_rest():
    palm = Palm.disc(85e-3, pitch=1e-3)
    assert palm.inside.sum() * 1e-6 == pytest.approx(np.pi * 0.0425**2, rel=2e-3)
    assert palm.inside[42, 42]
    np.testing.assert_array_equal(palm.inside, palm.inside[::-1, ::-1])
    assert palm.grid(0.2).position[palm.inside.ravel()].mean(axis=0) == pytest.approx([0, 0, 0.2])
    palm = Palm.disc(85e-3)
    beyond = palm.beyond(27.5e-3, 27.5e-3)
    # The square lies inside the disc whole; points on its edge belong to it.
    assert palm.inside.sum() - beyond.sum() == 23**2
    assert not palm.beyond(42.5e-3, 42.5e-3).any()


def test_an_outline_may_have_dents_and_letters_draw_it():
    # An L of three squares of 20 mm.
    corners = np.array([[-20, -20], [20, -20], [20, 0], [0, 0], [0, 20], [-20, 20]]) * 1e-3
    palm = Palm.within(corners, pitch=0.4e-3)
    assert palm.inside.sum() * 0.16e-6 == pytest.approx(1200e-6, rel=0.02)
    x, y = palm.grid(0.1).x, palm.grid(0.1).y
    assert not palm.inside[y > 1e-3][:, x > 1e-3].any()
    assert palm.inside[(y < -1e-3) & (y > -19e-3)][:, np.abs(x) < 19e-3].all()
    palm = Palm.within(np.array([[-20, -20], [20, -20], [0, 25]]) * 1e-3)
    np.testing.assert_array_equal(Palm.of_rows(palm.rows, pitch=palm.pitch).inside, palm.inside)
    assert set("".join(palm.rows)) == {"#", "."}


def test_a_wider_palm_is_wider_by_the_margin_on_all_sides():
    corners = np.array([[-40, -10], [40, -10], [40, 10], [-40, 10]]) * 1e-3
    palm = Palm.within(corners, pitch=2e-3).wider(10e-3, pitch=1e-3)
    x, y = palm.grid(0.1).x, palm.grid(0.1).y
    assert np.abs(x[palm.inside.any(axis=0)]).max() == pytest.approx(50e-3, abs=2e-3)
    assert np.abs(y[palm.inside.any(axis=1)]).max() == pytest.approx(20e-3, abs=2e-3)
    # Round at the corners.
    assert not palm.inside[0, 0]
    assert palm.inside.sum() * 1e-6 == pytest.approx(80e-3 * 20e-3 + 200e-3 * 10e-3 + np.pi * 10e-3**2, rel=0.05)


def test_a_path_faces_the_array_and_turns_with_its_tracker():
    palm = PalmPath(time=[0.0], centre=[[0.1, 0, 0.2]], normal=[[0, 0, -1]], fingers=[[0, 1, 0]], confidence=[0.5])
    np.testing.assert_array_equal(palm.rotation[0], np.eye(3))
    placed = TrackerPlacement(rotation=QUARTER, offset=[0, 0, 0.01]).path(palm)
    np.testing.assert_allclose(placed.centre, [[0, 0.1, 0.21]])
    np.testing.assert_allclose(placed.fingers, [[-1, 0, 0]])


QUARTER = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
