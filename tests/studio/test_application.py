import asyncio
import json
import os
import re
import signal
import time
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from starlette.websockets import WebSocketDisconnect
from tests.studio.conftest import ROOT, SOCKET, PageClient
from tests.waiting import wait_until

from midair.datasets import stroke
from midair.errors import DeviceStateError, ExposureError, InputError, StoppedError
from midair.files import load, load_solution, save
from midair.model import Medium, Provenance, Recording
from midair.patterns import Pattern
from midair.studio.jobs import StudioJob
from midair.studio.panels.draw_panel import PatternRequest, SaveForm, TakeNamed, preview_pattern
from midair.studio.panels.play_panel import CheckExposure, PlayNow
from midair.studio.studio_state import LARGEST_ORDER, MESSAGES_A_SECOND, Page, StudioState
from midair.studio.work import SolveRequest, solve_take


@pytest.fixture
def folder(folder):
    frames, of = stroke("towel", duration=0.2), Provenance(source="x")
    take = Recording(samples=frames.pressure, rate=frames.rate, sensor=frames.sensor, unit="Pa", provenance=of)
    save(take, folder / "towel.h5")
    return folder


def test_page_and_files_are_served(client):
    page = client.get("/")
    assert page.status_code == 200
    assert "midair studio" in page.text
    for name in ("app.js", "style.css", "view.js", "transport.js", "room-record.js", "icon.svg"):
        assert client.get(f"/web/{name}").status_code == 200, name
    assert client.get("/web/view.js").headers["content-type"].startswith("text/javascript")
    assert len(client.get("/colours/inferno").content) == 768
    for name in ("/web/nothing.js", "/web/..%2fapp.py", "/colours/../../x", "/colours/hot"):
        assert client.get(name).status_code == 404


def test_takes_that_a_command_wrote_are_listed(client, studio, talk):
    """When the page is loaded, and when it gets the focus again; one that it removed, until it is pressed."""
    takes = studio.folder.path
    for name, seen in (("loaded.h5", lambda: client.get("/")), ("focus.h5", lambda: talk.order("reproduce", "list"))):
        (takes / name).write_bytes((takes / "towel.h5").read_bytes())
        seen()
        assert name in [row["name"] for row in studio.store.state["takes"]]
    (takes / "focus.h5").unlink()
    assert "focus.h5: expected a file" in talk.order("reproduce", "open", take="focus.h5")["error"]
    assert [row["name"] for row in studio.store.state["takes"]] == ["loaded.h5", "towel.h5"]


@pytest.mark.long
def test_all_files_of_a_page_are_small_and_preloaded(client):
    """The page preloads every module, so that none waits for another; a line of 1 Mbit/s loads it within a second."""
    page = client.get("/").text
    wanted = set(re.findall(r'(?:href|src)="(/web/[^"]+)"', page))
    scripts = {name for name in wanted if name.endswith(".js")}
    imported = {name for script in scripts for name in re.findall(r'from "(/web/[^"]+)"', client.get(script).text)}
    tabs = re.findall(r'data-room="(\w+)" data-script="([^"]+)"', page)
    assert " ".join(name for name, _ in tabs) == "start record calibrate reproduce compare draw study live gallery"
    assert imported | {"/web/app.js"} | {script for _, script in tabs} == scripts
    received = 0
    for name in ["/", *wanted]:
        with client.stream("GET", name, headers={"accept-encoding": "gzip"}) as answer:
            assert answer.headers["content-encoding"] == "gzip"
            received += sum(map(len, answer.iter_raw()))
    assert received < 120_000


@pytest.mark.long
def test_drive_and_re_recording_are_replaced_only_with_consent(studio, talk):
    """A request must contain the current stamp of the files that it replaces."""
    folder = studio.folder.path
    drive, again = folder / "towel.drive.h5", folder / "towel.rerecorded.h5"
    solve_take(
        SolveRequest(take=str(folder / "towel.h5"), drive=str(drive), mode="paper", choices=(("method", "fast"),)),
        lambda *_: None,
    )
    again.write_bytes(b"played")
    studio.takes.comparison_path("towel.h5").write_bytes(b"compared")
    before = drive.read_bytes()

    def solve(**given):
        return talk.order("reproduce", "solve", take="towel.h5", mode="paper", method="live", **given)["ok"]

    asks = solve()["asks"]
    assert asks["files"] == ["towel.drive.h5", "towel.rerecorded.h5"]
    assert (asks["made"], asks["new"]) == ("made with paper, fast, 1000 Hz", "paper, live, 1000 Hz")
    assert solve(replaces="true")["asks"] == asks
    # A command wrote another one since the question.
    os.utime(drive, ns=(1, 1))
    anew = solve(replaces=asks["replaces"])["asks"]
    assert anew["replaces"] != asks["replaces"]
    assert studio.jobs.unfinished() == []
    assert (drive.read_bytes(), again.read_bytes()) == (before, b"played")
    assert solve(replaces=anew["replaces"])["take"] == "towel.h5"
    wait_until(lambda: not studio.jobs.unfinished(), 120)
    assert drive.read_bytes() != before
    assert not again.exists()
    assert not studio.takes.comparison_path("towel.h5").exists(), "the comparison was with the drive before"


def test_a_job_that_failed_is_told_while_many_others_wait(studio):
    for number in range(20):
        studio._show_job(StudioJob(number=number, title="", room="", state="waits" if number else "failed"))
    assert [job["state"] for job in studio.store.state["jobs"]] == ["failed", *["waits"] * 19]


@pytest.mark.long
def test_each_mode_of_a_take_has_a_drive_of_its_own(studio, talk):
    folder, drive = studio.folder.path, studio.folder.path / "towel.drive.h5"
    order = SolveRequest(take=str(folder / "towel.h5"), drive=str(drive), choices=(("method", "fast"),))
    solve_take(order, lambda *_: None)

    def solve(take="towel.h5", **given):
        answer = talk.order("reproduce", "solve", take=take, **given)["ok"]
        for job in studio.jobs.unfinished():
            studio.jobs.cancel(job.number)
        return answer.get("take") or answer["asks"]["files"]

    assert solve(mode="paper") == ["towel.drive.h5"], "asked, since its settings are those of the mode"
    assert solve(mode="paper", beside=True) == "towel.h5@paper"
    assert solve(mode="quick") == "towel.h5@quick"
    for name in ("towel.quick.drive.h5", "towel.paper.drive.h5"):
        (folder / name).write_bytes(drive.read_bytes())
    assert solve(mode="quick") == ["towel.quick.drive.h5"]
    assert solve("towel.h5@paper", mode="paper") == ["towel.paper.drive.h5"], "the drive in view, if it has the mode"
    assert solve(mode="paper", beside=True) == "towel.h5@paper-2"
    found = talk.order("reproduce", "drives", take="towel.h5@quick")["ok"]
    assert [(each["name"], each["mode"]) for each in found] == [
        ("towel.h5", "paper"), ("towel.h5@paper", "paper"), ("towel.h5@quick", "quick")
    ]  # fmt: skip
    assert talk.order("reproduce", "open", take="towel.h5@quick")["ok"]["drive"]["settings"]["method"] == "fast"


@pytest.mark.long
def test_edits_make_takes_and_are_undone_and_redone(studio, talk):
    folder = studio.folder.path
    before = (folder / "towel.h5").read_bytes()

    def order(what, **given):
        answer = talk.order("reproduce", what, **given)
        return answer.get("ok") or answer["error"]

    assert "expected an edit" in order("undo")
    assert order("edit", take="towel.h5", edit="cut", start="0.05s", end="0.15 s") == "towel-01.h5"
    assert order("edit", take="towel-01.h5", edit="gain", by="6dB") == "towel-02.h5"
    assert order("edit", take="towel-01.h5", edit="gain", by="much").startswith("By: expected a factor such as 2 or")
    made = load(folder / "towel-02.h5")
    assert [step.stage for step in made.provenance.steps][-2:] == ["cut", "gain"]
    assert made.duration == pytest.approx(0.1)
    assert (folder / "towel.h5").read_bytes() == before, "the original stays as it is"
    assert [order("undo"), order("undo"), order("redo"), order("undo")] == [
        "towel-01.h5", "towel.h5", "towel-01.h5", "towel.h5"
    ]  # fmt: skip
    assert [path.name for path in folder.glob("towel*.h5")] == ["towel.h5"]
    assert [order("redo"), order("redo")] == ["towel-01.h5", "towel-02.h5"]
    assert load(folder / "towel-02.h5").provenance == made.provenance
    assert studio.store.state["edits"] == {"undo": "towel-02.h5", "redo": ""}
    assert "expected this file, found none; solve first" in order("export", take="towel.h5", of="drive", ending=".npz")
    (folder / "exports").mkdir(exist_ok=True)
    (folder / "exports" / "towel-01.csv").write_text("kept")
    order("export", take="towel-01.h5", ending=".csv")
    order("export", take="towel-01.h5", ending=".flac", channel=5)
    wait_until(lambda: not studio.jobs.unfinished(), 120)
    assert sorted(path.name for path in (folder / "exports").iterdir()) == [
        "towel-01-2.csv", "towel-01.csv", "towel-01.flac"
    ]  # fmt: skip
    assert load(folder / "exports" / "towel-01.flac", scale=1.0).sensor.count == 1
    assert (folder / "exports" / "towel-01.csv").read_text() == "kept"
    assert order("edit", take="towel-01.h5", edit="delete", start="0.02s", end="0.05s") == "towel-03.h5"
    rest, whole = (load(folder / name).samples for name in ("towel-03.h5", "towel-01.h5"))
    assert (rest == np.concatenate([whole[:20], whole[50:]])).all()
    assert all("all or nothing" in order("edit", take="towel-01.h5", edit="delete", start=s, end=s) for s in ("", "1s"))


def test_request_without_cookie_is_refused(client):
    client.cookies.clear()
    for path in ("/", "/web/app.js", "/file/towel.h5", "/frames/samples/0?take=towel.h5"):
        assert client.get(path).status_code == 403
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(SOCKET, headers={"origin": ROOT}):
        pass


def test_a_file_of_the_folder_alone_is_served_as_an_attachment_and_a_report_as_a_sandboxed_page(client, studio):
    (studio.folder.path.parent / "secret").write_text("secret")
    for name in ("../secret", "%2e%2e/secret", "a%00b", "nothing.h5"):
        answer = client.get(f"/file/{name}")
        assert (answer.status_code, "secret\n" in answer.text) == (404, False), name
    (studio.folder.path / "towel.report.html").write_text("<script>alert(1)</script>")
    assert client.get("/file/towel.h5").headers["content-disposition"] == "attachment"
    policy = client.get("/file/towel.report.html").headers["content-security-policy"]
    assert ("sandbox" in policy, "script-src" in policy) == (True, False)


TOWEL = {"take": "towel.h5"}
REFUSED = [
    ("nowhere open", {}, "that this studio handles"),
    ("play louder", {}, "that this studio handles"),
    ("play play", {"clearance": "x"}, "clearance"),
    ("play stop", {"x": 1}, "x"),
    ("reproduce solve", {"take": "../x.h5"}, "leads out"),
    ("reproduce solve", {"take": "x.h5"}, "found none"),
    ("reproduce solve", TOWEL | {"gain": 0}, "gain"),
    ("reproduce solve", TOWEL | {"mode": "x"}, "mode"),
    ("reproduce solve", TOWEL | {"level": 7}, "level"),
    ("play check", TOWEL, "solve it first"),
    ("play play", {"clearance": 1}, "check its exposure"),
    ("play check", TOWEL | {"repeats": 0}, "repeats"),
    ("compare report", TOWEL, "play it first"),
    ("compare compare", TOWEL, "play it first"),
    ("record take", {}, "expected an open sensor"),
    ("record toggle", {}, "expected an open sensor"),
    ("record listen", {"sensor": "/dev/sda"}, "sensor"),
    ("jobs cancel", {"number": 7}, "it has ended"),
    ("control give", {}, "requests it"),
    ("reproduce rename", {"take": "x.h5", "name": "../x"}, "name: expected letters, digits, spaces, _ and -, a"),
    ("reproduce solve", {"take": "x.h5", "gain": -1}, "gain: expected greater than 0, got '-1'"),
    ("draw save", {"name": "", "pattern": {}}, "at least 1 character, got ''"),
    (
        "reproduce import",
        {"file": "x", "options": {"force": "1"}},
        "options.force.[key]: expected another text, got 'force'",
    ),
    ("live begin", {"clearance": 1}, "just checked"),
    ("live turn", {"share": 0.5}, "start it first"),
    ("live turn", {"share": 1.5}, "less than or equal to 1"),
    ("live turn", {"share": 0}, "greater than 0"),
    ("live keep", {}, "start live touch first"),
    ("live keep", {"seconds": 61}, "less than or equal to 60"),
    ("live check", {"sensor": "virtual:towel", "delay_ms": 1}, "greater than or equal to 2"),
    ("live check", {"sensor": "virtual:towel", "height_mm": 19}, "greater than or equal to 20"),
    ("live check", {"sensor": "virtual:towel", "height_mm": 1001}, "less than or equal to 1000"),
    ("live check", {"sensor": "/etc/passwd"}, "sensor: expected one such as lsl:NAME, got '/etc/passwd'"),
    ("live check", {"sensor": "virtual:towel", "calibration": "../other.h5"}, "leads out"),
    ("live check", {"sensor": "virtual:towel", "device": "autd3"}, "not permitted"),
    ("study new", {"name": "x", "template": "detection", "takes": ["towel.h5"] * 2}, "study: expected one take and no"),
    ("study new", {"name": "x", "takes": ["towel.h5"]}, "study: expected two or"),
    ("air state", {"temperature": "hot"}, "expected degrees Celsius"),
    ("reproduce solve", TOWEL | {"mode": "best", "method": "live"}, "choose fast or glide"),
]
"""Orders, what is given with them, and words of the refusal, which comes when it is ordered and not later."""


def test_invalid_request_gets_an_error_message(subtests, talk):
    for order, given, words in REFUSED:
        with subtests.test(order, given=given):
            talk.socket.send_text(json.dumps({"alive": True}))
            answer = talk.order(*order.split(), **given)
            assert words in answer["error"]
            assert "ok" not in answer
    for said, words in (({"order": "open"}, "room"), ({"room": "play", "order": "stop", "more": 1}, "more")):
        assert words in talk.say({"id": 500, **said})["error"]


def test_malformed_message_is_ignored_and_an_unreadable_one_refused_in_one_line(talk, capsys):
    for text in ["[]", "3", "null", '{"id": "x"}', '{"id": 0}', '{"drew": "many"}']:
        talk.socket.send_text(text)
        assert talk.order("play", "stop")["ok"] is True, text
    for text in ["", "x", "[" * 100_000, '{"a":' * 50_000]:
        talk.socket.send_text(text)
        while "set" in (answer := json.loads(talk.socket.receive_text())):
            pass
        assert (answer["id"], answer["error"].count("\n")) == (0, 0)
        assert answer["error"].startswith("request: expected JSON, got ")
        assert talk.order("play", "stop")["ok"] is True, text[:9]
    assert capsys.readouterr().err == ""


def test_page_without_control_may_only_stop(client, talk):
    with client.websocket_connect(SOCKET, headers={"origin": ROOT}) as socket:
        watcher = PageClient(socket)
        before = talk.order("play", "stop")
        assert before["ok"]
        for room, order, given in (
            ("reproduce", "solve", {"take": "towel.h5"}),
            ("play", "check", {"take": "towel.h5"}),
            ("play", "play", {"clearance": 1}),
            ("record", "take", {}),
            ("control", "give", {}),
        ):
            assert "this page may only watch" in watcher.order(room, order, **given)["error"]
        assert watcher.order("play", "stop")["ok"]
        assert watcher.order("control", "take")["ok"], "nothing sounds"
        assert "may only watch" in talk.order("record", "take")["error"]


def test_every_message_of_a_page_counts_and_one_that_sends_more_is_read_more_slowly(talk, monkeypatch):
    sizes, said = [], ['{"alive": true}', '{"drew": 1}', '{"whole": 1}', "x", "y" * 5000]
    with monkeypatch.context() as patch:
        patch.setattr(Page, "pause", lambda _, now, size: sizes.append(size) or 0.0)
        for text in said:
            talk.socket.send_text(text)
        assert talk.order("play", "stop")["ok"]
    assert sizes[: len(said)] == [len(text) for text in said]
    page = Page(1, None)
    assert [page.pause(5.0, 20) for _ in range(MESSAGES_A_SECOND)] == [0.0] * MESSAGES_A_SECOND, "those of one second"
    assert sum(page.pause(5.0, 20) for _ in range(3)) == pytest.approx(6 / MESSAGES_A_SECOND)
    assert page.pause(5.0, LARGEST_ORDER) == pytest.approx((3 + 257) / MESSAGES_A_SECOND), "4 KiB count as one"
    assert page.pause(60.0, 20) == 0.0
    calm = Page(2, None)
    assert all(calm.pause(number / 200, 20) == 0.0 for number in range(2000))


def test_one_whole_state_waits_for_a_page_and_has_every_change():
    store = StudioState(lambda: False)
    page = store.enter(None)
    for _ in range(1000):
        asyncio.run(store.on_message(page, '{"whole": 1}'))
    store.put(air=1)
    assert page.waiting.qsize() == 1
    whole = json.loads(asyncio.run(store.next_text(page)))
    assert (whole["page"], whole["whole"]["air"]) == (1, 1)
    store.put(air=2)
    assert json.loads(asyncio.run(store.next_text(page))) == {"number": whole["number"] + 1, "set": {"air": 2}}
    for number in range(1000):
        store.put(air=number)
    last = [json.loads(asyncio.run(store.next_text(page))) for _ in range(page.waiting.qsize())][-1]
    assert (last["whole"]["air"], last["number"]) == (999, whole["number"] + 1001), "a page that read nothing"
    assert not page.whole_waits


def test_upload_from_the_controlling_page_gets_a_new_name(client, studio, talk):
    def upload(name, data, page):
        return client.post("/upload", content=data, headers={"origin": ROOT, "x-name": name, "x-page": page})

    page = str(talk.page)
    assert upload("a.csv", b"1", "99").status_code == 400
    assert upload("..%2F..%2Fevil.html", b"1", page).status_code == 400
    answer = upload("My%20Take.csv", b"t,a\n0,1\n", page)
    name, _, file = answer.json()["ok"].partition("/")
    assert (answer.json()["imports"], file) == (True, "My Take.csv")
    assert (studio.takes.samples / "incoming" / name / file).read_bytes() == b"t,a\n0,1\n"
    assert studio.folder.names(".csv") == [], "nothing in the folder before it is imported"
    assert upload("take.h5", b"x", page).json() == {"ok": "take.h5", "imports": False}
    assert client.post("/upload", content=b"x", headers={"x-name": "a.csv", "x-page": page}).status_code == 403


def test_a_refused_project_is_named_and_removed(client, studio, talk, monkeypatch):
    async def refuse(_, __, order):
        raise InputError(f"{order[0]}: expected a project")

    monkeypatch.setattr(studio.reading, "result", refuse)
    headers = {"origin": ROOT, "x-name": "a.zip", "x-page": str(talk.page)}
    answer = client.post("/upload", content=b"x", headers=headers)
    assert answer.json() == {"error": "a.zip: expected a project"}
    assert list((studio.takes.samples / "incoming").iterdir()) == []


def test_lease_is_renewed_only_by_the_visible_page_that_armed_it(studio, client, talk):
    playing = studio.playing
    for device in ("virtual", "autd3:emulator"):
        playing._show(device=device)
        playing._controls = talk.page
        leave = playing.lease.arm(lasts=5)
        deadline = playing.lease.left
        talk.socket.send_text(json.dumps({"alive": True}))
        talk.order("reproduce", "nothing")
        soundless = device == "virtual"
        assert (playing.lease.left > deadline) == soundless, "renewed to half a second from now where there is sound"
        talk.socket.send_text(json.dumps({"alive": False}))
        talk.order("reproduce", "nothing")
        assert playing.lease.refusal(leave) == (None if soundless else "stopped")


def test_closed_page_revokes_its_lease(studio, client):
    with client.websocket_connect(SOCKET, headers={"origin": ROOT}) as socket:
        studio.playing._controls = PageClient(socket).page
        leave = studio.playing.lease.arm(lasts=5)
    assert studio.playing.lease.refusal(leave) == "stopped"


def test_code_shows_the_mode_the_chosen_settings_and_the_stated_air(talk, studio):
    assert talk.state["whole"]["air"]["degrees"] is None
    chosen = {"take": "towel.h5", "gain": 2, "height_mm": 180}
    assert talk.order("reproduce", "code", **chosen)["ok"]["options"] == "--mode best --gain 2 --height 180mm"
    assert talk.order("air", "state", temperature="25C", humidity=40)["ok"]
    options = talk.order("reproduce", "code", take="towel.h5", mode="paper")["ok"]["options"]
    assert "--temperature 25C --humidity 40%" in options
    assert studio.air.stated == {"temperature": 25.0, "humidity": 0.4}


def test_takes_of_one_stem_have_drives_of_their_own(studio):
    for name in ("towel.csv", "only.csv", "more.npy"):
        (studio.folder.path / name).write_bytes(b"")
    beside = {name: studio.takes.beside(name, ".drive.h5").name for name in ("towel.h5", "towel.csv", "only.csv")}
    assert beside == {
        "towel.h5": "towel.drive.h5", "towel.csv": "towel.csv.drive.h5", "only.csv": "only.drive.h5"
    }  # fmt: skip
    assert "more.npy" in [row["name"] for row in studio.takes.rows()]


def test_an_air_that_is_stated_during_a_check_needs_another_one(studio, monkeypatch):
    (studio.folder.path / "towel.drive.h5").write_bytes(b"")
    playing, room = studio.playing, SimpleNamespace(medium=None)

    async def admit(*_, **order):
        room.medium = Medium.at(temperature=25.0)
        return {"number": 1, "solved_c": 22.0, "room": order["room"]}

    monkeypatch.setattr(playing, "_air", room)
    monkeypatch.setattr(playing._player, "ask", admit)
    assert asyncio.run(playing.check(None, CheckExposure(take="towel.h5")))["room"] is None
    page = SimpleNamespace(visible=True, last_alive=time.monotonic(), number=1)
    with pytest.raises(DeviceStateError, match="the air of the room changed since the check"):
        asyncio.run(playing.play(page, PlayNow(clearance=1)))


def test_an_override_of_a_loop_does_not_admit_a_louder_drive(studio, monkeypatch):
    """The person answered for the drive that was checked; it is checked again as a loop, whose heat is a minute's."""
    drive = studio.folder.path / "towel.drive.h5"
    drive.write_bytes(b"")
    playing, asked = studio.playing, []
    checks = [
        {"number": number, "solved_c": 22.0, "excess_db": excess, "refused": "" if number else "louder"}
        for number, excess in ((1, 10.0), (2, 10.0), (3, 5.0), (0, 20.0))
    ]

    async def ask(what, **order):
        asked.append((what, order.get("up_to"), order.get("loop", False)))
        if what == "play":
            drive.write_bytes(b"solved meanwhile")
            os.utime(drive, ns=(1, len(asked)))
            return {}
        return checks.pop(0)

    monkeypatch.setattr(playing._player, "ask", ask)
    asyncio.run(playing.check(None, CheckExposure(take="towel.h5", override="A. Person")))
    page = SimpleNamespace(visible=True, last_alive=time.monotonic(), number=1)
    with pytest.raises(ExposureError, match="louder"):
        asyncio.run(playing.play(page, PlayNow(clearance=1, loop=True)))
    # A quieter drive between them changes nothing.
    again = [("admit", 10.01, True), ("play", None, False)]
    assert asked == [("admit", inf, False), *again, *again, again[0]]


@pytest.mark.long
def test_a_signal_ends_a_studio_without_a_word(studio_at, capfd):
    studio = studio_at(new=True)
    studio.process.terminate()
    assert studio.process.wait(30) == 128 + signal.SIGTERM
    assert capfd.readouterr().err == ""


def test_a_stop_between_the_sounds_of_a_presentation_ends_it(studio):
    playing = studio.playing
    playing.begin_presentation()
    playing.lease.stop()
    with pytest.raises(StoppedError, match="stopped on request"):
        asyncio.run(playing.quiet(1.0))


@pytest.mark.long
def test_drawn_pattern_is_saved_opened_and_never_replaced_silently(studio, monkeypatch):
    async def result(_, __, work, order):
        return work(order, lambda *_: None)

    monkeypatch.setattr("midair.studio.jobs.Jobs.result", result)
    panel, drive, one = studio.panels["draw"], studio.folder.path / "tap.drive.h5", TakeNamed(take="tap.toml")
    pattern = {"duration_s": 0.05, "spot": [{"pressure_pa": 20}]}
    form = SaveForm(name="tap", pattern=pattern, drive=True)
    assert asyncio.run(panel.save(None, form)) == {"saved": ["tap.toml", "tap.drive.h5"]}
    assert panel.open(None, one) == pattern
    assert len({Pattern.from_plain(plain).name for plain, *_ in panel._state["palette"].values()}) == 13
    louder = form.model_copy(update={"pattern": {**pattern, "spot": [{"pressure_pa": 40}]}})
    asked, quiet = asyncio.run(panel.save(None, louder))["asks"], load_solution(drive).drive.level.max()
    assert asked["files"] == ["tap.toml", "tap.drive.h5"]
    assert panel.open(None, one) == pattern
    asyncio.run(panel.save(None, louder.model_copy(update={"replaces": asked["replaces"]})))
    assert load_solution(drive).drive.level.max() == pytest.approx(2**0.5 * quiet)
    form.pattern["spot"][0]["signal"] = {"file": "../other.h5"}
    with pytest.raises(InputError, match="leads out"):
        asyncio.run(panel.preview(None, form))
    form.pattern["spot"][0]["signal"] = {"file": "towel.h5"}
    asyncio.run(panel.draft(None, form))
    assert load_solution(studio.takes.samples / "drawn" / "pattern.drive.h5").drive.level.std() > 0


@pytest.mark.long
def test_preview_of_a_pattern_has_the_place_and_the_law_of_the_pressure():
    def seen(pascal):
        spot = {"centre_mm": [10, -5], "pressure_pa": pascal, "am": {"frequency_hz": 200}}
        return preview_pattern(PatternRequest(pattern={"duration_s": 0.2, "spot": [spot]}), print)

    full, half = seen(40), seen(20)
    assert full["pressure"]["at_mm"] == full["motion"]["at_mm"] == [10, -5]
    # 40 Pa times 1/2 + 1/2 cos has the rms 40 sqrt(3/8).
    assert full["pressure"]["top"] == pytest.approx(40 * 0.375**0.5, rel=0.03)
    assert full["motion"]["top"] == pytest.approx(2 * half["motion"]["top"], rel=0.01)
    louder = {name: level + 20 * np.log10(2) for name, level in half["felt"]["over_threshold_db"].items()}
    assert full["felt"]["over_threshold_db"] == pytest.approx(louder, abs=0.1)
    assert full["exposure"]["peak_db"] == pytest.approx(half["exposure"]["peak_db"] + 3, abs=0.3)
