import numpy as np

from midair.physics import Place


def test_the_cube_of_a_place_is_looked_at_in_its_corners_its_faces_and_its_middle():
    points = Place(name="ear", position=(0.1, -0.2, 0.4), reach=0.03, limit=100.0).points
    assert points.shape == (27, 3)
    np.testing.assert_allclose(points.min(axis=0), [0.07, -0.23, 0.37])
    np.testing.assert_allclose(points.max(axis=0), [0.13, -0.17, 0.43])
    np.testing.assert_allclose(points[13], [0.1, -0.2, 0.4])
    assert len(np.unique(points, axis=0)) == 27
