import numpy as np

from midair.files import profile_named
from midair.model import Acoustics, TransducerArray
from midair.physics import cone_points

ARRAY = TransducerArray.autd3()
EAR = profile_named("occupational-110").places[0]


def test_points_lie_in_the_cube_and_closer_steps_make_more_of_them():
    wide, close = (cone_points(EAR, ARRAY, Acoustics(), step=step) for step in (1.8, 0.9))
    for points in (wide, close):
        away = np.abs(points - np.array(EAR.position)).max(axis=1)
        assert away.max() <= EAR.reach + 1e-9
        assert len(np.unique(points, axis=0)) == len(points)
    assert 3 * len(wide) < len(close)
