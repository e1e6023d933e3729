"""The sound of random errors of the transducers, against the field of random errors."""

import numpy as np

from midair.files import profile_named
from midair.model import Acoustics, Drive, TransducerArray
from midair.physics import level_if_unlike, sound_level, transfer_matrix

ARRAY = TransducerArray.autd3()
PROFILE = profile_named("occupational-110")


def test_it_is_near_the_loudest_of_many_points():
    rng = np.random.default_rng(5)
    level = rng.uniform(0, 1, (2, ARRAY.count))
    drive = Drive(phase=rng.uniform(0, 6, level.shape), level=level, rate=1e3, array=ARRAY, acoustics=Acoustics())
    ear = PROFILE.places[0]
    points = np.array(ear.position) + rng.uniform(-ear.reach, ear.reach, (400, 3))
    G = transfer_matrix(points, ARRAY, acoustics=drive.acoustics)
    errors = 0.2 / np.sqrt(2) * (rng.normal(size=(20, 996)) + 1j * rng.normal(size=(20, 996)))
    loudest = [np.abs((drive.q * error) @ G.T).max() for error in errors]
    found = level_if_unlike(drive, PROFILE)[0]
    assert abs(found - sound_level(np.mean(loudest))) < 2
    shared = Drive(phase=drive.phase, level=np.ones(2), rate=1e3, array=ARRAY)
    assert level_if_unlike(shared, PROFILE, 0.2)[0] > found
