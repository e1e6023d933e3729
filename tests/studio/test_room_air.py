"""The stated air of the room: typed or measured, used for new drives, and compared with the drive that plays."""

import asyncio
import time

import pytest
from tests.drives import log
from tests.waiting import wait_until

from midair.errors import MidairError
from midair.model import Medium
from midair.studio.room_air import AirForm, RoomAir
from midair.studio.studio_state import StudioState


@pytest.fixture(name="air")
def _air(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    made = RoomAir(StudioState(lambda: False), lambda act, *values: act(*values), every=0.01)
    yield made
    made.close()


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


@pytest.mark.parametrize(
    ("temperature", "humidity", "words"),
    [
        ("warm", None, "expected degrees Celsius such as 22C"),
        ("70C", None, "expected 0 to 50 degrees Celsius, got 70"),
        ("", 50, "expected a temperature with it"),
        ("lsm:Room", None, "expected lsl:PLACE"),
        ("file:nothing.txt", None, "expected a readable file"),
    ],
)
def test_wrong_air_is_refused_and_the_stated_one_stays(air, temperature, humidity, words):
    state(air, "23C", 30)
    with pytest.raises(MidairError, match=words):
        state(air, temperature, humidity)
    assert air.medium == Medium.at(temperature=23.0, humidity=0.3)


def test_a_thermometer_is_followed_until_another_air_is_stated(air, tmp_path):
    room = tmp_path / "room.txt"
    room.write_text("22.5", encoding="utf-8")
    assert state(air, f"file:{room}")["degrees"] == 22.5
    room.write_text("23.75", encoding="utf-8")
    wait_until(lambda: air.stated["temperature"] == 23.75)
    room.unlink()
    wait_until(lambda: "no longer checked: file:" in air._store.state["air"]["problem"])
    assert air.stated["temperature"] == 23.75
    room.write_text("22", encoding="utf-8")
    wait_until(lambda: not air._store.state["air"]["problem"])
    state(air, "25C")
    room.write_text("19", encoding="utf-8")
    time.sleep(0.1)
    assert air.stated["temperature"] == 25.0


def test_a_drift_from_the_drive_that_plays_is_logged_once(air, tmp_path):
    room = tmp_path / "room.txt"
    room.write_text("22.9", encoding="utf-8")
    state(air, f"file:{room}")
    air.plays("autd3", 22.0)
    room.write_text("23.0", encoding="utf-8")
    wait_until(lambda: air.stated["temperature"] == 23.0)
    room.write_text("24.0", encoding="utf-8")
    wait_until(lambda: air.stated["temperature"] == 24.0)
    air.plays()
    air.plays("autd3", 24.5)
    (entry,) = log()
    assert (entry["event"], entry["device"], entry["measured_c"], entry["solved_c"]) == ("air", "autd3", 23.0, 22.0)
    state(air, "30C")
    air.plays("autd3", 22.0)
    assert len(log()) == 1, "a typed temperature is no measurement"
