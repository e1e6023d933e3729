"""The airs of a room cover its range with the spacing that the phases over an array need."""

from itertools import product

import numpy as np
import pytest

from midair.files import profile_named
from midair.model import Medium, TransducerArray
from midair.physics import airs_of_room
from midair.physics.exposure_search import STEP

PLACES = profile_named("occupational-110").places
ROOMS = [None, Medium.at(temperature=22.0, humidity=0.3), Medium(speed=344.0), Medium.at(temperature=1.0)]


def test_phases_change_little_from_one_air_to_the_next():
    arrays = TransducerArray.autd3(), TransducerArray.autd3(columns=1, rows=1)
    for room, array, place in product(ROOMS, arrays, PLACES):
        speeds = np.array([each.medium.speed for each in airs_of_room(room, PLACES, array)])
        assert (np.diff(speeds) > 0).all(), (room, array)
        path = np.linalg.norm(place.points[:, None] - array.position, axis=2)
        phase = 2 * np.pi * array.frequency * path / speeds[:, None, None]
        # A phase common to all transducers has no effect.
        phase -= 2 * np.pi * array.frequency * np.linalg.norm(place.points, axis=1)[:, None] / speeds[:, None, None]
        assert np.abs(np.diff(phase, axis=0)).max() < 1.05 * STEP, (room, array, place)


def test_they_hold_all_that_the_room_may_have_which_a_stated_humidity_narrows():
    unknown = [each.medium for each in airs_of_room(None, PLACES, TransducerArray.autd3())]
    stated = [each.medium for each in airs_of_room(Medium.at(temperature=22.0), PLACES, TransducerArray.autd3())]
    for airs, coldest, warmest in ((unknown, 15.0, 30.0), (stated, 20.0, 24.0)):
        for humidity in (0.1, 0.5, 0.9):
            ends = [Medium.at(temperature=each, humidity=humidity) for each in (coldest, warmest)]
            assert airs[0].speed <= ends[0].speed
            assert airs[-1].speed >= ends[1].speed
            for one, air in ((airs[0], ends[0]), (airs[-1], ends[1])):
                assert one.attenuation < air.attenuation + 5e-3
    array = TransducerArray.autd3()
    dry = Medium.at(temperature=22.0, humidity=0.15)
    airs = [each.medium for each in airs_of_room(dry, PLACES, array)]
    assert airs[-1].speed == pytest.approx(Medium.at(temperature=24.0, humidity=0.35).speed)
    assert all(0.02 < air.attenuation < dry.attenuation for air in airs)
    damp = [each.medium for each in airs_of_room(Medium.at(temperature=22.0, humidity=0.8), PLACES, array)]
    assert min(air.attenuation for air in damp) > 0.11
    known = Medium(speed=345.0, attenuation=0.03)
    assert {each.medium.attenuation for each in airs_of_room(known, PLACES, array)} == {0.03}
