import json

import pytest
from tests.studio.conftest import ROOT, SOCKET, PageClient

from midair.model import Acoustics, Medium


def begin(talk, *, alive=True):
    """Begin with the checked settings; returns the error."""
    talk.socket.send_text(json.dumps({"alive": alive}))
    return talk.order("live", "begin", clearance=3)["error"]


@pytest.mark.usefixtures("talk")
def test_watching_page_sees_live_touch_and_changes_nothing(client, studio):
    with client.websocket_connect(SOCKET, headers={"origin": ROOT}) as socket:
        second = PageClient(socket)
        assert second.order("live", "sight", shown=True)["ok"]
        for order, given in (("begin", {"clearance": 1}), ("turn", {"share": 0.5}), ("keep", {}), ("end", {})):
            assert "may only watch" in second.order("live", order, **given)["error"]
        assert second.order("live", "sight", shown=False)["ok"]
    assert studio.panels["live"].feed.waiting == 0


def test_state_is_known_before_anything_plays(talk, studio):
    (studio.folder.path / "skin.calibration.h5").write_bytes(b"")
    assert talk.state["whole"]["live"]["state"] == "idle"
    assert "live_about" not in talk.state["whole"]
    talk.order("live", "sight", shown=True)
    assert studio.store.state["live"]["calibrations"] == ["skin.calibration.h5"]


@pytest.fixture
def checked(studio):
    """The settings that were checked last."""
    request = {"sensor": "virtual:towel", "device": "virtual", "acoustics": None}
    studio.panels["live"]._checked = {3: request}
    yield request
    assert not studio.playing.lease.armed
    assert studio.store.state["live"]["state"] == "idle"


def test_nothing_is_armed_without_a_player(talk, checked):
    assert "player" in begin(talk)
    assert "just checked" in begin(talk), "a check is used up by what it allowed"


def test_an_error_of_the_studio_is_answered(talk, checked, capsys):
    checked.clear()
    assert "error in midair, please report it: KeyError" in begin(talk)
    assert "Traceback" in capsys.readouterr().err


def test_a_stop_while_the_sensor_is_closed_is_not_forgotten(talk, studio, checked, monkeypatch):
    async def release():
        studio.playing.lease.stop()

    monkeypatch.setattr(studio.panels["record"], "release", release)
    assert "stopped on request" in begin(talk)


def test_live_begins_only_in_the_air_of_its_check(talk, checked):
    checked["acoustics"] = Acoustics(medium=Medium.at(temperature=22.0))
    assert "the air of the room changed" in begin(talk)


def test_hidden_page_cannot_begin(talk, studio, checked):
    studio.playing._show(device="autd3:emulator")
    assert "to be visible" in begin(talk, alive=False)
