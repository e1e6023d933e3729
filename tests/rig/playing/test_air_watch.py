import json
import time

import pytest
from tests.waiting import wait_until

from midair.devices import state_folder
from midair.model import Medium
from midair.rig import thermometer_named, watch_air


@pytest.fixture(name="room")
def _room(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    return tmp_path / "room.txt"


def watched(room, said, device=""):
    return watch_air(
        thermometer_named(f"file:{room}"), Medium.at(), said.append, advice="solve it again", device=device, every=0.01
    )


def test_a_drift_of_one_degree_is_reported_and_logged_once(room):
    room.write_text("22.9", encoding="utf-8")
    said = []
    with watched(room, said, "an array"):
        time.sleep(0.1)
        assert not said
        room.write_text("23.0", encoding="utf-8")
        wait_until(lambda: said)
        room.write_text("24.0", encoding="utf-8")
        time.sleep(0.1)
    assert said == [f"air: file:{room} measures 23.0 °C, the drive was solved for 22.0 °C; solve it again"]
    (line,) = (state_folder() / "played.jsonl").read_text(encoding="utf-8").splitlines()
    entry = json.loads(line)
    assert (entry["event"], entry["device"], entry["measured_c"], entry["solved_c"]) == ("air", "an array", 23.0, 22.0)
    assert entry["thermometer"] == f"file:{room}"


def test_a_thermometer_that_fails_is_reported_once_and_read_again(room):
    room.write_text("22.0", encoding="utf-8")
    said = []
    with watched(room, said):
        room.unlink()
        wait_until(lambda: said)
        time.sleep(0.1)
        assert len(said) == 1
        assert "the temperature is no longer checked: file:" in said[0]
        room.write_text("20.5", encoding="utf-8")
        wait_until(lambda: len(said) == 2)
    assert "measures 20.5 °C, the drive was solved for 22.0 °C" in said[1]
    assert not (state_folder() / "played.jsonl").exists()


def test_nothing_happens_without_a_thermometer():
    with watch_air(None, Medium(), pytest.fail, advice=""):
        pass
