"""The stated air of the room: as it is typed."""

import asyncio

import pytest

from midair.errors import MidairError
from midair.model import Medium
from midair.studio.room_air import AirForm, RoomAir
from midair.studio.studio_state import StudioState


@pytest.fixture(name="air")
def _air():
    return RoomAir(StudioState(lambda: False))


def state(air, temperature="", humidity=None):
    asyncio.run(air.state(None, AirForm(temperature=temperature, humidity=humidity)))
    return air._store.state["air"]


def test_a_typed_temperature_is_stated_and_an_empty_one_takes_it_back(air):
    assert (air.medium, air.stated) == (None, {})
    for typed in ("24", "24C", " 24.0 °C "):
        assert state(air, typed, 40)["degrees"] == 24.0
        assert air.medium == Medium.at(temperature=24.0, humidity=0.4)
    assert state(air, "24C")["humidity"] is None
    assert air.stated == {"temperature": 24.0}, "a humidity that nobody typed is not stated"
    assert state(air)["degrees"] is None
    assert air.medium is None


def test_wrong_air_is_refused_and_the_stated_one_stays(air):
    state(air, "23C", 30)
    for temperature, humidity, words in (
        ("warm", None, "expected degrees Celsius such as 22C"),
        ("70C", None, "expected 0 to 50 degrees Celsius, got 70"),
        ("", 50, "expected a temperature with it"),
        ("lsl:Room", None, "expected degrees Celsius such as 22C"),
    ):
        with pytest.raises(MidairError, match=words):
            state(air, temperature, humidity)
        assert air.medium == Medium.at(temperature=23.0, humidity=0.3)
