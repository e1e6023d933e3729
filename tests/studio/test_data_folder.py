import json
import time
from contextlib import suppress

import pytest
from tests.hostile import hostile_folder

from midair.studio.importing import run_command


@pytest.mark.long
def test_no_process_of_the_studio_runs_a_data_folder(studio_at, tmp_path, monkeypatch):
    """The player, the processes of jobs, sensor and live touch, and the command of an import, in the current folder."""
    (folder := tmp_path / "data").mkdir()
    marks = tmp_path / "marks"
    hostile_folder(folder, marks)
    monkeypatch.chdir(folder)
    studio = studio_at(new=True)
    cookie = studio.enter()
    with studio.connect(cookie) as socket:
        first = json.loads(socket.recv())
        state, orders, errors = first["whole"], iter(range(1, 100)), []

        def until(ended):
            end = time.monotonic() + 60
            while time.monotonic() < end:
                socket.send('{"alive": true}')
                with suppress(TimeoutError):
                    said = socket.recv(0.1)
                    said = json.loads(said) if isinstance(said, str) else {}
                    state.update(said.get("set", {}))
                    if ended(said):
                        return said
            raise AssertionError(state)

        def order(room, name, **given):
            number = next(orders)
            socket.send(json.dumps({"id": number, "room": room, "order": name, "with": given}))
            said = until(lambda said: said.get("id") == number)
            errors.extend([said["error"]] if "error" in said else [])
            return said

        headers = {"Cookie": cookie, "X-Name": "a.csv", "X-Page": str(first["page"])}
        answer, text = studio.ask("POST", "/upload", b"t,x\n0,1\n0.001,2\n0.002,3\n", headers)
        assert answer.status == 200, text
        order("reproduce", "import", file=json.loads(text)["ok"], options={"unit": "V"}, save=False)
        order("record", "listen", sensor="virtual:towel")
        until(lambda _: state["player"]["state"] == "ready")
        order("live", "check", sensor="virtual:brush")
        order("live", "begin", clearance=state["exposure"]["number"])
        until(lambda _: state["live"]["state"] == "plays")
        order("live", "end")
        until(lambda _: not [job for job in state["jobs"] if job["state"] in ("waits", "runs")])
    assert errors == []
    assert not marks.exists()


def test_a_command_of_the_studio_runs_the_installed_midair(tmp_path, monkeypatch):
    hostile_folder(tmp_path, tmp_path / "marks")
    monkeypatch.chdir(tmp_path)
    assert run_command("--version").strip()
    assert not (tmp_path / "marks").exists()
