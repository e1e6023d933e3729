"""The panel Study with its processes: the studio ends while a drive is presented."""

import hashlib
import json
import threading
import time
import warnings
from types import SimpleNamespace

import pytest
from tests.drives import plan_of, save_drive

from midair.studio import Studio, StudioPlan
from midair.studio.panels.study_panel import StudyPanel
from midair.study import StudyFolder, read_design
from midair.study.session.event_log import read_events

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from starlette.testclient import TestClient

PORT = 8347
ROOT = f"http://127.0.0.1:{PORT}"
PLAN = plan_of("f.drive.h5")


@pytest.mark.long
def test_the_studio_ends_in_time_while_a_drive_is_presented(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    folder, samples = tmp_path / "folder", tmp_path / "samples"
    folder.mkdir()
    samples.mkdir()

    def long_drive(into):
        """A quiet drive of a minute and its digest."""
        path = save_drive(into / "f.drive.h5", frames=3000, rate=50.0)
        return {"f.drive.h5": hashlib.sha256(path.read_bytes()).hexdigest()}

    study = StudyFolder.create(folder / "s", PLAN, read_design(PLAN), drives=long_drive)
    studio = Studio(StudioPlan(folder=folder), samples, PORT)
    presents, ended = threading.Event(), threading.Event()

    def present():
        client = TestClient(studio.application(), base_url=ROOT)
        client.cookies.set(studio.keys.cookie, studio.keys.session)
        headers = {"origin": ROOT}
        with client, client.websocket_connect(f"ws://127.0.0.1:{PORT}/socket", headers=headers) as page:
            state = json.loads(page.receive_text())["whole"]

            def live():
                while not ended.wait(0.1):
                    page.send_text('{"alive": true}')

            threading.Thread(target=live, daemon=True).start()

            def until(true):
                limit = time.monotonic() + 120
                while not true(state) and time.monotonic() < limit:
                    said = json.loads(page.receive_text())
                    state.update(said.get("set", {}))
                    assert not said.get("error"), said
                assert true(state)

            def order(number, name, **given):
                page.send_text(json.dumps({"id": number, "room": "study", "order": name, "with": given}))

            until(lambda now: now["player"]["state"] == "ready")
            order(1, "begin", study="s", participant=1, noise="none")
            until(lambda now: now.get("session"))
            while state["session"]["step"]["kind"] == "show":
                turn = state["session"]["step"]["turn"]
                order(2, "acknowledge")
                until(lambda now, turn=turn: now["session"]["step"]["turn"] != turn)
            order(3, "present")
            until(lambda now: now["player"]["done"] > 0)
            presents.set()
            ended.set()

    page = threading.Thread(target=present, daemon=True)
    page.start()
    assert presents.wait(200)
    page.join(30)
    assert not page.is_alive(), "the studio has not ended"
    events = [(each["event"], each.get("reason")) for each in read_events(study.path / "sessions" / "sub-01.jsonl")]
    assert ("stop", "the studio was ended") in events


def test_the_experimenter_or_a_stop_ends_the_wait_for_an_object():
    for set_by in ("_confirmed", "_ended"):
        told, panel = [], SimpleNamespace(_confirmed=threading.Event(), _ended=threading.Event())
        panel._tell = told.append
        threading.Timer(0.05, getattr(panel, set_by).set).start()
        StudyPanel._wait_for_experimenter(panel)
        assert told == [""]
