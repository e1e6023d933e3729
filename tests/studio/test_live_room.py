import json
import warnings

import pytest

from midair.model import Acoustics, Medium
from midair.studio import Studio, StudioPlan

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from starlette.testclient import TestClient

ROOT = "http://127.0.0.1:8346"


@pytest.fixture
def studio(tmp_path):
    folder, samples = tmp_path / "folder", tmp_path / "samples"
    folder.mkdir()
    samples.mkdir()
    made = Studio(StudioPlan(folder=folder), samples, 8346)
    yield made
    made.panels["live"].close()
    made.playing.close()
    made.jobs.close()


@pytest.fixture
def client(studio):
    client = TestClient(studio.application(), base_url=ROOT)
    client.cookies.set(studio.keys.cookie, studio.keys.session)
    return client


def page(client):
    return client.websocket_connect("ws://127.0.0.1:8346/socket", headers={"origin": ROOT})


def ask(socket, order, **given):
    socket.send_text(json.dumps({"id": 7, "room": "live", "order": order, "with": given}))
    while True:
        answer = json.loads(socket.receive_text())
        if answer.get("id") == 7:
            return answer


@pytest.mark.parametrize(
    ("order", "given", "words"),
    [
        ("begin", {"admission": 1}, "just checked"),
        ("turn", {"share": 0.5}, "start it first"),
        ("turn", {"share": 1.5}, "less than or equal to 1"),
        ("turn", {"share": 0}, "greater than 0"),
        ("keep", {}, "start live touch first"),
        ("keep", {"seconds": 61}, "less than or equal to 60"),
        ("check", {"sensor": "virtual:towel", "delay_ms": 1}, "greater than or equal to 2"),
        ("check", {"sensor": "virtual:towel", "height_mm": 19}, "greater than or equal to 20"),
        ("check", {"sensor": "virtual:towel", "height_mm": 1001}, "less than or equal to 1000"),
        ("check", {"sensor": "/etc/passwd"}, "match pattern"),
        ("check", {"sensor": "virtual:towel", "calibration": "../other.h5"}, "leads out"),
        ("check", {"sensor": "virtual:towel", "device": "autd3"}, "not permitted"),
    ],
)
def test_invalid_live_order_gets_an_error_message(client, order, given, words):
    with page(client) as socket:
        assert words in ask(socket, order, **given)["error"]


def test_watching_page_sees_live_touch_and_changes_nothing(client, studio):
    with page(client) as _, page(client) as second:
        assert ask(second, "sight", shown=True)["ok"]
        for order, given in (("begin", {"admission": 1}), ("turn", {"share": 0.5}), ("keep", {}), ("end", {})):
            assert "may only watch" in ask(second, order, **given)["error"]
        assert ask(second, "sight", shown=False)["ok"]
    assert studio.panels["live"].feed.waiting == 0


def test_state_is_known_before_anything_plays(client, studio):
    (studio.folder.path / "skin.calibration.h5").write_bytes(b"")
    with page(client) as socket:
        said = json.loads(socket.receive_text())
        assert said["whole"]["live"]["state"] == "idle"
        assert "live_about" not in said["whole"]
        ask(socket, "sight", shown=True)
    assert studio.store.state["live"]["calibrations"] == ["skin.calibration.h5"]


def test_nothing_is_armed_if_the_array_cannot_be_lent(client, studio):
    """Without a player, checked settings do not start and the lease stays revoked."""
    studio.panels["live"]._checked = {3: _request()}
    with page(client) as socket:
        socket.send_text(json.dumps({"alive": True}))
        assert "player" in ask(socket, "begin", admission=3)["error"]
        assert "just checked" in ask(socket, "begin", admission=3)["error"], "a check is used up by what it allowed"
    assert not studio.playing.permit.armed
    assert studio.store.state["live"]["state"] == "idle"


def test_an_error_of_the_studio_is_answered(client, studio, capsys):
    studio.panels["live"]._checked = {3: {}}
    with page(client) as socket:
        socket.send_text(json.dumps({"alive": True}))
        assert "error in midair, please report it: KeyError" in ask(socket, "begin", admission=3)["error"]
    assert "Traceback" in capsys.readouterr().err


def test_a_stop_before_the_array_is_lent_is_not_forgotten(client, studio, monkeypatch):
    asked = []

    async def let_go(do, **_):
        asked.append(do)
        if do == "let go":
            studio.playing.permit.stop()
        return {"units": "", "count": 996, "simulated": True}

    monkeypatch.setattr(studio.playing._player, "ask", let_go)
    studio.panels["live"]._checked = {3: _request()}
    with page(client) as socket:
        socket.send_text(json.dumps({"alive": True}))
        assert "stopped on request" in ask(socket, "begin", admission=3)["error"]
    assert asked[0] == "let go"
    assert not studio.playing.permit.armed
    assert studio.store.state["live"]["state"] == "idle"


def test_live_begins_only_in_the_air_of_its_check(client, studio):
    request = _request() | {"acoustics": Acoustics(medium=Medium.at(temperature=22.0))}
    studio.panels["live"]._checked = {3: request}
    with page(client) as socket:
        socket.send_text(json.dumps({"alive": True}))
        assert "the air of the room changed" in ask(socket, "begin", admission=3)["error"]


def test_hidden_page_cannot_begin(client, studio):
    studio.panels["live"]._checked = {3: _request()}
    with page(client) as socket:
        socket.send_text(json.dumps({"alive": False}))
        assert "to be visible" in ask(socket, "begin", admission=3)["error"]
    assert not studio.playing.permit.armed


def _request():
    return {"sensor": "virtual:towel", "device": "virtual", "acoustics": None}
