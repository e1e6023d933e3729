"""The studio in a real browser."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest
import soundfile
from axe_playwright_python.sync_playwright import Axe
from tests.palms import palm_path

from midair.files import load, save_palm_path
from midair.rig import record
from midair.studio.work import SolveRequest, solve_take

pytestmark = pytest.mark.browser


def test_other_pages_cannot_reach_the_studio(studio_at, look, chromium):
    """A page of this computer, but of another port, in the very browser that has the cookie."""
    studio = studio_at()
    page = look(studio)

    # The rest of what is refused is in test_request_guard.py.
    elsewhere = look(studio_at(), context=page.page.context)
    said = elsewhere.page.evaluate(
        """async (root) => {
            const socket = new WebSocket(root.replace('http', 'ws') + '/socket');
            const opened = await new Promise(done => {
                socket.onopen = () => done('open'); socket.onerror = () => done('refused'); });
            const asked = await fetch(root + '/', {credentials: 'include'}).then(() => 'answered', () => 'refused');
            const how = {method: 'POST', mode: 'no-cors', credentials: 'include', body: 'x'};
            const posted = await fetch(root + '/upload', how)
                .then(() => 'answered', () => 'refused');
            return [opened, asked, posted];
        }""",
        studio.root,
    )
    assert said == ["refused", "refused", "refused"]
    elsewhere.wrong.clear()  # what the browser itself refused
    assert page.until("Object.keys(studio.link.state).length > 3")
    assert list(studio.folder.iterdir()) == []


def test_stop_by_button_by_escape_in_a_text_field_and_from_a_watching_page(studio_at, look):
    """The page that watches may also take control, in silence."""
    page = look(studio := studio_at())
    page.towel()
    page.until("studio.link.state.player.state === 'ready'", timeout=120)

    def begin():
        found = page.page.evaluate("studio.link.order('play', 'check', {take: 'sample:towel', repeats: 30})")
        page.page.evaluate(
            """number => { studio.ended = ''; studio.link.order('play', 'play', {clearance: number})
            .then(() => { studio.ended = 'played'; }, wrong => { studio.ended = wrong.message; }); }""",
            found["number"],
        )
        page.until("studio.link.state.player.emitting && studio.link.state.player.done > 0")
        assert page.page.evaluate("studio.ended") == ""

    def silent():
        page.until("studio.ended !== ''", timeout=5)
        assert "stopped on request" in page.page.evaluate("studio.ended")
        assert not page.page.evaluate("studio.link.state.player.emitting")

    begin()
    page.page.locator("#stop").click()
    silent()
    begin()
    page.page.get_by_label("Gain").focus()
    page.press("Escape")
    silent()
    begin()
    watching = look(studio, context=page.page.context)
    # The first page is behind the second one, but a browser without windows reports it as visible.
    assert not watching.page.evaluate("studio.link.controls")
    assert "may only watch" in watching.page.locator("#banner").inner_text()
    watching.page.locator("#stop").click()
    silent()
    watching.page.locator("#take-control").click()
    watching.until("studio.link.controls")
    page.until("!studio.link.controls")
    assert "may only watch" in page.page.locator("#banner").inner_text()


def test_every_key_of_the_transport(studio_at, look):
    """Those of the standalone view reach the transport; the address has panel, take and time, and Back works."""
    page = look(studio_at())
    page.towel()
    press = page.page.keyboard.press
    page.page.locator("#main").focus()
    if page.page.evaluate("studio.room.transport.playing"):
        press("Space")

    def at():
        return page.page.evaluate("studio.room.transport.frame")

    press("Home")
    assert at() == 0
    page.page.evaluate("studio.room.transport.seek(742)")
    page.until("location.hash.includes('t=0.742')")
    press("Alt+2")
    page.until("studio.name === 'record'")
    page.page.go_back()
    page.until("studio.name === 'reproduce' && studio.room?.transport?.frame === 742")
    told = page.page.evaluate("import('/web/keys.js').then(keys => keys.TABLE.length)")
    press("?")
    assert page.page.locator("#help tr").count() == told
    press("Escape")
    rooms = ("start", "record", "calibrate", "reproduce", "compare", "draw", "study", "live")
    for number, room in enumerate(rooms, start=1):
        press(f"Alt+{number}")
        page.until(f"studio.name === {room!r}")
    press("Alt+2")
    page.until("studio.name === 'record' && studio.room?.big && !studio.room.big.disabled")
    press("r")
    page.until("studio.link.state.record.state === 'recording'")
    press("r")
    page.until("studio.link.state.record.state === 'listening' && !!studio.link.state.record.take")
    page.page.get_by_label("Object").focus()
    press("r")
    assert page.page.evaluate("studio.link.state.record.state") == "listening", "letters are letters in a text field"


@pytest.fixture
def with_takes(studio_at, made_once):
    """A studio whose folder has a take with a drive, one without, and two invalid files."""

    def fill(folder):
        record("virtual:towel", 0.2, path=folder / "solved.h5")
        record("virtual:brush", 0.2, path=folder / "bare.h5")
        choices = (("method", "glide"), ("gain", 1.5), ("height", 0.19))
        files = {"take": str(folder / "solved.h5"), "drive": str(folder / "solved.drive.h5")}
        solve_take(SolveRequest(**files, mode="paper", choices=choices), lambda *_: None)
        (folder / "solved.rerecorded.h5").write_bytes(b"heard")
        (folder / "corrupt.h5").write_bytes((folder / "bare.h5").read_bytes()[:9000])
        (folder / "no.h5").write_text("no recording")

    studio = studio_at()
    shutil.copytree(made_once("takes_of_studio", fill), studio.folder, dirs_exist_ok=True)
    return studio


def form(page):
    """Settings of Reproduce that every mode has."""
    return page.page.evaluate("Object.values(studio.room.inputs).slice(0, 6).map(input => input.value)")


def test_settings_and_code_belong_to_the_shown_drive_which_is_replaced_with_consent(with_takes, look, tmp_path):
    page = look(studio := with_takes)

    def code():
        page.page.get_by_role("button", name="Show the code").click()
        page.until("document.querySelector('#code').open")
        shown = page.page.locator("#code pre").all_inner_texts()
        page.press("Escape")
        return shown

    page.towel()
    assert form(page) == ["paper", "", "live", "auto", "1", ""], "the sample's drive is made quickly, and tells so"
    commands, python = code()
    runs = [["-m", *line.split()] for line in commands.splitlines()]
    assert {words[1] for words in runs} == {"midair"}
    for words in [*runs, ["-c", python]]:
        done = subprocess.run([sys.executable, *words], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    page.take("bare.h5")
    assert form(page) == ["best", "", "", "", "1", ""], "without a drive: those of the command"
    page.take("solved.h5")
    assert form(page) == ["paper", "", "glide", "", "1.5", "190"]
    said = page.page.locator("#in-view").inner_text()
    assert said == "Drive in view: paper, glide, 1000 Hz, gain 1.5, height 190mm."
    jobs = page.page.evaluate("studio.link.state.jobs.map(job => job.number).join()")
    page.page.get_by_label("Mode").select_option("best")
    assert form(page) == ["best", "", "", "", "1.5", "190"], "the solver is the mode's"
    able = "[...studio.room.inputs.method.options].filter(one => !one.disabled).map(one => one.value)"
    assert page.page.evaluate(able) == ["", "fast", "glide"]
    assert "Solve makes a new drive" in page.page.locator("#in-view").inner_text()
    assert page.page.evaluate("studio.link.state.jobs.map(job => job.number).join()") == jobs
    commands, python = code()
    assert "midair solve solved.h5 --mode paper --gain 1.5 --height 190mm --method glide\n" in commands
    assert "settings = Settings.from_plain(" in python
    page.page.get_by_label("Mode").select_option("paper")
    drive, again = studio.folder / "solved.drive.h5", studio.folder / "solved.rerecorded.h5"
    before = drive.read_bytes()
    page.page.get_by_label("Solver").select_option("live")

    def ask():
        page.page.get_by_role("button", name="Solve", exact=True).click()
        page.until("document.querySelector('#replace').open")
        return page.page.locator("#replace").inner_text()

    words = ask()
    assert "Replace solved.drive.h5?" in words
    assert "solved.drive.h5 exists, made with paper, glide, 1000 Hz, gain 1.5, height 190mm." in words
    assert "solved.rerecorded.h5, its re-recording, is removed with it." in words
    assert "The new drive: paper, live, 1000 Hz, gain 1.5, height 190mm." in words
    dialog = page.page.get_by_role("alertdialog", name="Replace solved.drive.h5?")
    assert dialog.count() == 1
    assert page.page.evaluate("document.activeElement.innerText") == "Cancel"
    assert page.serious() == []
    page.press("Enter")
    ask()
    page.press("Escape")
    page.until("!document.querySelector('#replace').open")
    assert (drive.read_bytes(), again.read_bytes()) == (before, b"heard")
    ask()
    # A command writes another drive while the dialog is open: the page must ask again about that drive.
    os.utime(drive, ns=(7, 7))
    page.press("Shift+Tab")
    assert page.page.evaluate("document.activeElement.innerText") == "Replace"
    page.press("Enter")
    page.until("document.querySelector('#replace').open")
    assert drive.read_bytes() == before
    page.press("Shift+Tab", "Enter")
    page.until("studio.room.take?.facts.drive?.settings.method === 'live'", timeout=120)
    assert not again.exists()
    assert page.page.locator("#in-view").inner_text() == "Drive in view: paper, live, 1000 Hz, gain 1.5, height 190mm."


def test_a_take_is_cut_by_its_loop_undone_redone_and_exported_and_key_b_shows_its_other_drive(with_takes, look):
    files = {"take": str(with_takes.folder / "solved.h5"), "drive": str(with_takes.folder / "solved.best.drive.h5")}
    solve_take(SolveRequest(**files, choices=(("method", "fast"),)), lambda *_: None)
    page = look(with_takes)
    page.take("bare.h5")
    page.page.locator("#main").focus()
    for frame, key in ((50, "i"), (150, "o")):
        page.page.evaluate("frame => studio.room.transport.seek(frame)", frame)
        page.page.keyboard.press(key)
    assert page.serious() == []
    page.page.get_by_role("button", name="Keep").click()
    page.until("studio.room.take?.name === 'bare-01.h5' && studio.room.take.facts.frames === 100")
    page.page.locator("#main").focus()
    page.press("Control+z")
    page.until("studio.room.take?.name === 'bare.h5'")
    assert not (with_takes.folder / "bare-01.h5").exists()
    page.press("Control+Shift+z")
    page.until("studio.room.take?.name === 'bare-01.h5'")
    page.page.get_by_role("button", name="Export").click()
    page.page.get_by_label("As", exact=True).select_option(".csv")
    page.page.locator("#replace").get_by_role("button", name="Export").click()
    page.until("document.querySelector('#exported')?.download === 'bare-01.csv'")
    assert (with_takes.folder / "exports" / "bare-01.csv").exists()
    before = (with_takes.folder / "solved.drive.h5").read_bytes()
    page.take("solved.h5")
    page.until("document.querySelectorAll('#drives button').length === 2")
    assert page.page.locator(".takes li").count() == len(page.page.evaluate("studio.link.state.takes"))
    page.page.evaluate("studio.room.transport.seek(77)")
    page.page.locator("#main").focus()
    page.press("b")
    page.until("studio.room.take?.name === 'solved.h5@best'")
    assert "paper, fast" in page.page.locator("#in-view").inner_text()
    assert page.page.evaluate("studio.room.transport.frame") == 77
    assert "#reproduce/solved.h5@best" in page.page.url
    assert page.page.locator("#drives [aria-pressed=true]").inner_text().startswith("best E ")
    page.press("b")
    page.until("studio.room.take?.name === 'solved.h5'")
    page.until("studio.room.played.peak?.value > 0")
    page.page.get_by_label("Solver").select_option("live")
    page.page.get_by_role("button", name="Solve", exact=True).click()
    page.page.get_by_role("button", name="Keep both").click()
    page.until("studio.room.take?.name === 'solved.h5@paper' && !!studio.room.take.facts.drive", timeout=120)
    assert "paper, live" in page.page.locator("#in-view").inner_text()
    assert (with_takes.folder / "solved.drive.h5").read_bytes() == before
    page.until("document.querySelectorAll('#drives button').length === 3")
    assert page.serious() == []


def test_the_take_of_the_address_is_shown_or_why_it_cannot_be_opened(with_takes, look):
    page = look(with_takes)
    page.go("#compare/gone.h5")
    page.until("document.querySelector('#main').innerText.includes('gone.h5: there is no such take')")
    page.go("#reproduce/%")
    page.until("document.querySelector('#main').innerText.includes('% cannot be opened')")
    for name in ("corrupt.h5", "no.h5", "gone.h5"):
        page.take("solved.h5")
        assert not page.page.locator("#problem").is_visible()
        page.until("studio.link.state.player.state === 'ready' && !studio.room.play.disabled", timeout=120)
        page.go(f"#reproduce/{name}")
        page.until("!document.querySelector('#problem').hidden")
        # Messages at the bottom of the page disappear after 7 s.
        page.page.wait_for_timeout(8000 if name == "no.h5" else 0)
        said = page.page.locator("#problem").inner_text()
        assert f"{name.removesuffix('.h5')} cannot be opened" in said
        assert name in said
        assert "sblock" not in said
        assert page.page.locator("#problem").get_attribute("role") == "alert"
        assert not page.page.locator("canvas").count()
        assert page.page.locator("#in-view").inner_text() == ""
        for button in ("Solve", "Play on array"):
            assert page.page.get_by_role("button", name=button, exact=True).is_disabled()
        assert f"#reproduce/{name}" in page.page.url
        assert page.page.evaluate("studio.room.list.querySelectorAll('[aria-current]').length") == (name != "gone.h5")
    page.page.get_by_role("button", name="Close").click()
    assert not page.page.locator("#problem").is_visible()

    # The first answer arrives late, while the list of takes changes: the first take must not be shown.
    page.take("bare.h5")
    page.page.evaluate(
        """() => { const order = studio.link.order.bind(studio.link); studio.late = 0;
        studio.link.order = async (room, what, given) => {
            const answer = await order(room, what, given);
            const first = given?.take === 'sample:towel';
            if (what === 'open') await new Promise(done => first ? studio.release = done : setTimeout(done, 300));
            studio.late += given?.take === 'sample:towel';
            return answer; }; }"""
    )
    page.go("#reproduce/sample:towel")
    page.until("studio.room.wish === 'sample:towel'")
    assert page.page.evaluate("studio.room.take") is None, "what is in view has the name of the address"
    page.until("document.querySelector('#box-wanted').innerText.includes('opening towel')")
    page.go("#reproduce/solved.h5")
    page.page.evaluate("studio.room._takes(studio.link.state.takes)")
    page.until("studio.room.take?.name === 'solved.h5'")
    # An address is typed while a take is drawn: its event comes after that of the picture.
    page.page.evaluate("location.hash = '#reproduce/bare.h5'; studio.here('solved.h5', 0.1)")
    page.until("studio.release !== undefined")
    page.page.evaluate("studio.release()")
    page.until("studio.late > 0 && studio.room.take?.name === 'bare.h5'")
    assert "#reproduce/bare.h5" in page.page.url
    # The same, while another panel is being opened.
    page.page.evaluate("location.hash = '#record'; studio.here('bare.h5', 0.1)")
    page.until("studio.name === 'record'", timeout=20)


def test_exposure_on_emulated_units_is_refused_attenuated_or_overridden_by_name(studio_at, look):
    page = look(studio := studio_at("--device", "autd3:emulator"))
    page.towel()
    page.until("studio.link.state.player.state === 'ready'", timeout=120)
    page.page.get_by_role("button", name="Play on array").click()
    page.until("!!document.querySelector('#exposure p.bad')", timeout=60)
    ways = page.page.locator("#exposure").inner_text()
    assert re.findall(r"(\d+ of 10 people|solve it to see)", ways)[1] == "solve it to see"
    assert len(re.findall(r"\d+ of 10 people", ways)) == 3
    assert "--" not in ways, "options of the command line"
    assert page.page.get_by_role("button", name="Attenuate").is_visible()
    assert page.page.locator("#hold").is_disabled()
    assert "dB too loud for unprotected ears: " in page.page.locator("#exposure p").first.inner_text()
    page.page.get_by_role("button", name="Answer for it").click()
    assert page.page.locator("#hold").is_disabled(), "a name is required"
    page.page.get_by_label("Your name").fill("Ada")
    page.page.get_by_role("button", name="Answer for it").click()
    page.until("document.querySelector('#exposure p').innerText.startsWith('overridden')", timeout=60)
    assert not page.page.locator("#exposure .stop").is_visible(), "nothing plays"
    page.hold_to_play()
    page.until("studio.link.state.player.said === 'played to its end'", timeout=60)
    lines = (studio.state / "played.jsonl").read_text(encoding="utf-8").splitlines()
    order = next(line for line in map(json.loads, lines) if line["event"] == "play")
    assert (order["exposure"], order["override_by"]) == ("overridden", "Ada")
    # The page behind the dialog cannot be pressed: it has a STOP of its own.
    page.page.locator("#exposure").get_by_role("button", name="Close").click()
    page.page.get_by_role("button", name="Play on array").click()
    page.until("!!document.querySelector('#exposure p.bad')", timeout=60)
    page.page.get_by_label("Your name").fill("Ada")
    page.page.get_by_role("button", name="Answer for it").click()
    page.until("document.querySelector('#exposure p').innerText.startsWith('overridden')", timeout=60)
    page.hold_to_play()
    page.until("studio.link.state.player.emitting")
    page.page.locator("#exposure .stop").click()
    page.until("studio.link.state.player.said.includes('stopped on request')")


def test_a_wav_becomes_a_take_and_an_import_asks_what_a_file_does_not_state(studio_at, look, tmp_path):
    """Choose a file, correct a wrong word, look at the preview, import; the take is that of the same command."""
    wave = tmp_path / "Corduroy.wav"
    soundfile.write(wave, 0.5 * np.sin(2 * np.pi * 150 * np.arange(8000) / 8000), 8000)
    page = look(studio := studio_at(), at="start")
    page.until("studio.name === 'start' && !studio.room.file.disabled")
    page.page.locator("input[type=file]").set_input_files(wave)
    page.until("document.querySelector('#import .course polygon')", timeout=60)
    size = page.page.get_by_role("textbox", name="How large?")
    size.fill("3o")
    size.press("Tab")
    assert "expected a quantity such as" in page.until("document.querySelector('#import-wrong').textContent")
    assert page.page.get_by_role("button", name="Import").is_disabled()
    size.fill("15")
    size.press("Tab")
    page.until("!document.querySelector('#import .main').disabled")
    page.page.get_by_label("How does it move?").select_option("circles on the palm")
    assert page.page.get_by_label("At the edge?").is_hidden(), "a circle stays on the palm"
    page.until("document.querySelector('#import pre').textContent.includes('circle:15mm --path=circle --speed=50mm/s')")
    palm = "[...document.querySelector('#import canvas').getContext('2d').getImageData(0, 0, 280, 372).data].join()"
    whole = page.page.evaluate(palm)
    page.page.get_by_label("time of the film").fill("0.5")
    page.until(f"{palm} !== {whole!r} && document.querySelector('.player output').value === '0.50 s'")
    page.page.get_by_role("button", name="Play", exact=True).click()
    page.until(f"{palm} === {whole!r}")  # the film has ended
    assert Axe().run(page.page).response["violations"] == []
    page.until("!document.querySelector('#import .main').disabled")
    command = page.page.locator("#import pre").inner_text()
    page.page.get_by_role("button", name="Import").click()
    page.until("studio.room?.take?.name === 'Corduroy.h5'")
    words = shlex.split(command.replace("Corduroy.wav", f"{shlex.quote(str(wave))} same.h5"))
    subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, check=True)
    made, same = (load(path).samples for path in (studio.folder / "Corduroy.h5", tmp_path / "same.h5"))
    assert (made == same).all()

    # The questions and proposals are those of `midair import` on a terminal; all else is folded away.
    bare, whole = tmp_path / "bare.csv", tmp_path / "whole.csv"
    wave = np.sin(np.arange(200) / 3)
    bare.write_text("x,y\n" + "".join(f"{each:.6f},{-each:.6f}\n" for each in wave))
    whole.write_text("time [s],x [V]\n" + "".join(f"{i / 1000},{each:.6f}\n" for i, each in enumerate(wave)))
    page.go("#reproduce")
    page.until("studio.room?.add && !studio.room.add.disabled")
    page.page.locator("input[type=file]").set_input_files(bare)
    page.until("document.querySelector('#import .course polygon')", timeout=60)
    shown = "[...document.querySelectorAll('#import .field')].filter((one) => one.checkVisibility())"
    names = (
        shown
        + ".map((one) => `${one.querySelector('label').textContent} ${one.lastElementChild.previousSibling.value}`)"
    )
    assert page.page.evaluate(names) == ["Rate 1000Hz", "Unit V", "How strong? ", "Scale ", "Channels 0", "Layout "]
    page.page.get_by_role("textbox", name="Rate").fill("")
    page.page.get_by_role("textbox", name="Rate").press("Tab")
    assert "frame rate" in page.until("document.querySelector('#import-wrong').textContent")
    page.page.get_by_role("textbox", name="Rate").fill("2kHz")
    page.page.get_by_role("textbox", name="Rate").press("Tab")
    page.until("!document.querySelector('#import .main').disabled")
    assert "--rate=2kHz --channels=0" in page.page.locator("#import pre").inner_text()
    labels = "[...document.querySelectorAll('#import [aria-label]')].map((one) => one.ariaLabel)"
    assert not [label for label in page.page.evaluate(labels) if "/" in label], "the folder of the upload"
    page.page.locator("#import").get_by_role("button", name="Cancel", exact=True).click()
    page.page.locator("input[type=file]").set_input_files(whole)
    page.until("document.querySelector('#import-title').textContent.includes('whole')", timeout=60)
    page.until("document.querySelector('#import .course polygon')", timeout=60)
    assert page.page.evaluate(names) == []
    assert page.page.get_by_text("The file gives all values that are needed.").is_visible()


def test_a_designer_goes_from_a_wav_to_the_report_of_a_study(studio_at, look, tmp_path):
    """WAV, level, best mode, play, correction, A/B with sound, cut, study of three takes, report; no command typed."""
    wave = tmp_path / "Corduroy.wav"
    ribs = np.sin(2 * np.pi * 150 * np.arange(2000) / 8000) * (1 + np.sin(2 * np.pi * 12 * np.arange(2000) / 8000))
    soundfile.write(wave, 0.4 * ribs, 8000)
    studio = studio_at()
    page = look(studio, viewport={"width": 1440, "height": 900})
    page.page.evaluate(
        """() => { studio.acts = 0;
        for (const name of ['click', 'change']) addEventListener(name, () => { studio.acts += 1; }, true); }"""
    )
    button = lambda name: page.page.get_by_role("button", name=name, exact=True)  # noqa: E731

    def compared(take):
        """Play the take in view and wait for its comparison."""
        page.until("!studio.room.play.disabled && document.querySelectorAll('.job').length === 0", timeout=120)
        button("Play on array").click()
        page.until("!document.querySelector('#hold').disabled", timeout=60)
        page.hold_to_play()
        page.until("!!document.querySelector('#to-compare')", timeout=60)
        button("Check and play again").click()
        page.until("!document.querySelector('#hold').disabled && !document.querySelector('#to-compare')", timeout=60)
        button("Close").click()
        page.page.get_by_role("link", name="Compare", exact=True).click()
        page.until(f"studio.room.name === {take!r} && !!studio.room.found", timeout=120)

    page.until("studio.room?.add && !studio.room.add.disabled")
    page.page.locator("input[type=file]").set_input_files(wave)
    page.until("document.querySelector('#import .course polygon')", timeout=60)
    page.page.get_by_label("How strong?").select_option("strong")
    page.page.get_by_role("textbox", name="How fast").fill("150mm/s")
    page.page.get_by_role("textbox", name="How fast").press("Tab")
    page.until("document.querySelector('#import pre')?.textContent.includes('150mm')")
    page.until("!document.querySelector('#import .main').disabled")
    button("Import").click()
    page.until("studio.room?.take?.name === 'Corduroy.h5'")
    assert page.page.get_by_label("Mode").input_value() == "best"
    button("Solve").click()
    page.until("!!studio.room.take?.facts.drive && studio.room.played?.peak?.value > 0", timeout=240)
    before = page.page.evaluate("studio.acts")
    compared("Corduroy.h5")
    judged = page.page.locator(".compare .verdict").inner_text()
    page.go("#reproduce/Corduroy.h5")
    page.until("document.querySelector('.reproduce .verdict')?.hidden === false")
    assert page.page.locator(".reproduce .verdict").inner_text() == judged
    page.go("#compare/Corduroy.h5")
    page.until("!!studio.room.found")
    gain = page.page.evaluate("studio.room.found.measured_gain")
    button("Apply").click()
    page.until("document.querySelector('#replace').open")
    button("Keep both").click()
    page.until("studio.room.take?.name === 'Corduroy.h5@best' && !!studio.room.take.facts.drive", timeout=240)
    compared("Corduroy.h5@best")
    assert abs(page.page.evaluate("studio.room.found.measured_gain") - 1) < abs(gain - 1)
    page.page.evaluate("studio.room.listen.sounds.again.preload = 'metadata'; studio.room.listen.sounds.again.load()")
    page.until("studio.room.listen.sounds.again.duration > 0.2")
    page.page.locator("#main").focus()
    page.press("b")
    page.until("studio.room.name === 'Corduroy.h5' && !!studio.room.transport")
    page.until("document.querySelectorAll('.job').length === 0", timeout=120)
    button("Make the report").click()
    page.until("!document.querySelector('#to-report').hidden", timeout=300)
    assert " of 10 people" in (studio.folder / "Corduroy.report.html").read_text(encoding="utf-8")
    page.page.get_by_role("link", name="Reproduce").click()
    beside = page.page.evaluate("studio.acts") - before
    for edit, made in (("Keep", 1), ("Fade in", 2)):
        page.until("!!studio.room?.take && !studio.room.editing[0].disabled")
        page.page.evaluate("studio.room.transport.setLoop({from: studio.room.transport.rate / 10, on: true})")
        button(edit).click()
        page.until(f"studio.room.take?.name === 'Corduroy-0{made}.h5'", timeout=60)
    page.page.get_by_role("link", name="Study").click()
    page.until("document.querySelectorAll('#own-study option[value$=\".h5\"]').length === 3")
    page.page.get_by_label("Name", exact=True).fill("cord")
    page.page.get_by_label("Participants").fill("5")
    page.page.get_by_label("takes and patterns to present").select_option(
        ["Corduroy.h5", "Corduroy-01.h5", "Corduroy-02.h5"]
    )
    page.page.get_by_label("Question", exact=True).fill("Which cloth did you feel?")
    page.page.get_by_label("Second question (may stay empty)").fill("How rough was it?")
    kind = page.page.get_by_label("Kind")
    kind.select_option("threshold")
    assert "Choose one:" in page.page.locator("#own-study").inner_text()
    assert not page.page.get_by_label("Question", exact=True).is_visible()
    kind.select_option("own")
    assert page.serious() == []
    page.page.locator("#new-study").click()
    page.until("document.querySelector('#simulate')?.disabled === false", timeout=240)
    page.page.locator("#simulate").click()
    page.until("document.querySelector('#analyse')?.disabled === false", timeout=120)
    page.page.locator("#analyse").click()
    page.until("document.querySelector('#to-report')", timeout=120)
    again = page.page.evaluate(
        "studio.link.order('study', 'simulate', {study: 'cord'}).catch((wrong) => wrong.message)"
    )
    assert again.startswith("cord: expected a study without answers")
    with page.page.context.expect_page() as opened:
        page.page.locator("#to-report").click()
    opened.value.wait_for_load_state()
    report = opened.value.inner_text("body")
    for words in ("SIMULATED", "5 participants", "Corduroy-02", "Which cloth did you feel?", "How rough was it?"):
        assert words in report
    acts = page.page.evaluate("studio.acts")
    assert acts < 60
    assert acts - beside <= 20, "without play, correction and report of the take"


def test_the_palm_of_a_tracker_is_seen_in_words_and_pictures_and_followed_by_keyboard(studio_at, look):
    studio = studio_at()
    time_s = np.arange(3000) / 50
    away = np.stack([8 * np.sin(time_s), 5 * np.cos(time_s), 4 * np.sin(2 * time_s)], axis=1) * 1e-3
    away[time_s > 50] += [0.06, 0, 0]
    save_palm_path(palm_path(time_s, away + np.array([0, 0, 0.2]), tilt=0.1), studio.folder / "hand.csv")
    page = look(studio)
    page.towel()
    page.until("studio.link.state.player.state === 'ready' && !studio.room.play.disabled", timeout=120)
    keyboard = page.page.keyboard
    page.page.get_by_role("button", name="Play on array").focus()
    keyboard.press("Enter")
    tracker = page.page.get_by_label("Follow the palm of a tracker")
    tracker.fill("replay:hand.csv")
    keyboard.press("Tab")
    keyboard.type("20")
    keyboard.press("Tab")
    page.until("document.querySelector('#palm-words').textContent.includes('in the box')", timeout=60)
    words = page.page.locator("#palm-words").inner_text()
    assert re.search(r"Palm at \(-?\d+, -?\d+, (?:20|19)\d\) mm, tilted 6°", words)
    assert "Confidence 1.00" in words
    assert page.page.locator("#palm svg .limit").count() == page.page.locator("#palm svg .ahead").count() == 2
    page.until("!document.querySelector('#hold').disabled", timeout=60)
    page.page.emulate_media(color_scheme="light")
    page.page.set_viewport_size({"width": 390, "height": 900})
    page.until("document.querySelector('dialog[open]').scrollWidth <= innerWidth", timeout=5)
    assert Axe().run(page.page, "dialog[open]").response["violations"] == []
    page.page.locator("#hold").focus()
    keyboard.down("Enter")
    page.until("studio.link.state.player.state === 'plays'", timeout=10)
    keyboard.up("Enter")
    page.until("document.querySelector('dialog[open] [role=status]').textContent.includes('re-recorded as')")
    tracker.fill("replay:nothing.csv")
    keyboard.press("Tab")
    page.until("document.querySelector('#toasts').textContent.includes('nothing.csv')")
