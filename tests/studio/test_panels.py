"""The panels in a real browser: Calibrate, Study, warnings of Record, and accessibility of all panels."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PIL import Image
from tests.study.every_kind import QUESTIONS, plan_text

from midair.rig import record
from midair.studio.work import SolveRequest, solve_take
from midair.study import StudyFolder, answers_table, prepare_media, read_design
from midair.study.session.event_log import read_events

pytestmark = pytest.mark.browser

PLANS = Path(__file__).with_name("plans")
DESIGN = (PLANS / "three.toml").read_text(encoding="utf-8")
PLAYED = (PLANS / "felt.toml").read_text(encoding="utf-8")

PRESENTS = """void studio.link.on('session', session =>
    session?.due && studio.link.order('study', 'presented').catch(() => {}))"""
"""The experimenter presents as soon as the page requests it. Void, since Playwright calls returned functions."""

SCREENS = (("dark", 1280, 800, 0), ("light", 1280, 800, 0), ("light", 390, 800, 190), ("dark", 700, 450, 165))
"""Scheme, width and height; on small screens, the most height of the parts that stay."""

ROOMS = ("record", "calibrate", "reproduce", "compare", "draw", "study", "live", "gallery")


HEEDED = "performance.now() - studio.room.asked > 200"
"""The page takes keys."""


def answers(study, folder="sessions"):
    return [event for event in read_events(study.path / folder / "sub-01.jsonl") if event["event"] == "answer"]


def begin(page, *, pilot=False):
    page.go("#study")
    page.until("!!document.querySelector('[data-participant=\"1\"]')")
    if pilot:
        page.page.locator("#pilot").check()
    page.page.locator('[data-participant="1"]').click()
    page.until("!!studio.link.state.session")
    page.page.evaluate(PRESENTS)
    page.go("#study/participant")
    page.until("!!document.querySelector('.participant')")


def trials(page, count):
    """Answer some trials with the keyboard only."""
    for _ in range(count):
        page.until("!!document.querySelector('#next') && studio.link.state.session.step.kind === 'present'")
        page.until(HEEDED)
        page.press("Enter")
        page.until("studio.link.state.session.step.kind === 'ask' && !!document.querySelector('#question')")
        page.until(HEEDED)
        number = page.page.evaluate("studio.link.state.session.step.number")
        page.press("2")
        page.until(
            f"studio.link.state.session.step.number !== {number} || studio.link.state.session.step.kind === 'done'"
        )


@pytest.fixture
def study(studio_at):
    studio = studio_at()
    return studio, StudyFolder.create(studio.folder / "three", DESIGN, read_design(DESIGN))


def texts(page):
    for _ in range(2):
        page.until("studio.link.state.session.step.kind !== 'show' || !!document.querySelector('#next')")
        if page.page.evaluate("studio.link.state.session.step.kind") == "show":
            shown = page.page.evaluate("studio.link.state.session.step.text")
            page.page.locator("#next").click()
            page.until(f"studio.link.state.session.step.text !== {json.dumps(shown)}")


def test_a_study_of_12_trials_by_keyboard_survives_a_reload_and_a_kill(study, studio_at, look):
    studio, study = study
    page = look(studio)
    begin(page)
    texts(page)
    trials(page, 3)
    shown = page.page.locator(".participant").inner_text()
    assert not any(word in shown for word in ("brush", "sponge", "towel")), "blind: no word of what comes"
    page.page.reload()
    page.until("globalThis.studio?.link?.page > 0 && !!document.querySelector('#next')")
    if not page.page.evaluate("studio.link.controls"):
        page.page.evaluate("studio.link.order('control', 'take')")
        page.until("studio.link.controls")
    page.page.evaluate(PRESENTS)
    trials(page, 2)
    assert len(answers(study)) == 5
    studio.process.kill()
    studio.process.wait()
    page.page.close()
    page.wrong.clear()  # connections to the studio that is gone
    again = studio_at()
    again.folder.rmdir()
    studio.folder.rename(again.folder)
    second = look(again)
    begin(second)
    texts(second)
    trials(second, 7)
    second.until("studio.link.state.session.step.kind === 'done'")
    kept = answers(StudyFolder(again.folder / "three"))
    assert len(kept) == 12
    assert {event["answer"] for event in kept} == {"sponge"}


def test_pilot_is_marked_and_stored_apart_and_keys_choose_only_what_they_name(study, look):
    studio, study = study
    page = look(studio)
    begin(page, pilot=True)
    assert page.page.evaluate("document.body.classList.contains('pilot')")
    assert "PILOT" in page.page.locator("#transport").inner_text()
    page.until(HEEDED)
    page.press(*5 * ["Space", "Enter"])
    assert page.page.evaluate("studio.link.state.session.step.consent") == "take part", "a key is no consent"
    texts(page)
    # After a reload, nobody answers for the experimenter, who finds the way to the button from this page.
    page.page.reload()
    page.until("globalThis.studio?.link?.page > 0 && !!document.querySelector('#next')")
    page.page.evaluate("studio.link.controls || studio.link.order('control', 'take')")
    page.until("studio.link.controls")
    page.until(HEEDED)
    page.press("Enter")
    page.page.locator("#to-confirm").click()
    page.page.locator("#presented").click()
    page.until("studio.link.state.session.step.kind === 'ask'")
    page.go("#study/participant")
    page.page.locator("#question").wait_for()
    assert page.page.evaluate("document.activeElement.id") == "question", "no answer has the focus"
    page.page.evaluate("studio.room.asked = performance.now(); dispatchEvent(new KeyboardEvent('keydown', {key: '2'}))")
    page.until(HEEDED)
    page.press(*5 * ["Space", "Enter"])
    assert page.page.evaluate("studio.link.state.session.step.kind") == "ask"
    assert answers(study, "pilot") == []
    page.press("2")
    page.until("studio.link.state.session.step.kind === 'present'")
    assert page.page.evaluate("studio.link.state.session.log") == ["trial 1 presented", "trial 1: answered"]
    assert not (study.path / "sessions" / "sub-01.jsonl").exists()
    assert len(answers(study, "pilot")) == 1
    page.press("Escape")
    page.until("studio.link.state.session.step.kind === 'stopped'")
    events = read_events(study.path / "pilot" / "sub-01.jsonl")
    assert events[-1]["event"] == "stop"
    assert next(event for event in events if event["event"] == "open")["pilot"] is True
    assert [event["by"] for event in events if event["event"] == "answer"] == ["page"]
    assert [event["to"] for event in events if event["event"] == "consent"] == ["take part"]
    page.go("#study")
    page.page.locator("#end-session").click()
    page.until("!studio.link.state.session")
    begin(page, pilot=True)
    assert page.page.locator("#next").inner_text() == "I agree to go on"


def drive_of(folder):
    record("virtual:towel", 0.2, path=folder / "towel.h5")
    made = str(folder / "weak.drive.h5")
    choices = (("method", "fast"), ("level", 0.01))
    solve_take(SolveRequest(take=str(folder / "towel.h5"), drive=made, choices=choices), lambda *_: None)
    (folder / "towel.h5").unlink()
    return {"weak.drive.h5": hashlib.sha256((folder / "weak.drive.h5").read_bytes()).hexdigest()}


def test_trial_plays_its_drive_with_the_player_of_the_studio(studio_at, look):
    """Consent, a form, a drive and an equally long silence on emulated units; form questions appear once."""
    studio = studio_at("--device", "autd3:emulator")
    study = StudyFolder.create(studio.folder / "felt", PLAYED, read_design(PLAYED), drives=drive_of)
    page = look(studio)
    page.until("studio.link.state.player.state === 'ready'", timeout=120)
    page.go("#study")
    page.until("!!document.querySelector('[data-participant=\"1\"]')")
    assert page.page.locator("#main option").first.inner_text() == "felt: Felt or not", "its name before its title"
    assert "white noise at -20 dB" in page.page.locator("#main").inner_text()
    page.page.get_by_label("Noise in the headphones").select_option("none")
    page.page.locator('[data-participant="1"]').click()
    page.until("!!studio.link.state.session || !!document.querySelector('#begins.bad')", timeout=60)
    assert not page.page.locator("#begins").is_visible(), page.page.locator("#begins").inner_text()
    page.go("#study/participant")
    page.page.get_by_role("button", name="I have read this, and take part").click()
    page.until("document.querySelector('#question')?.innerText.startsWith('How old')")
    turn = page.page.evaluate("studio.link.state.session.step.turn")
    page.page.get_by_label("How old are you?").fill("31")
    page.press("Tab")
    page.until(HEEDED)
    page.press("Enter")
    page.until("document.querySelector('#question')?.innerText.startsWith('How tired')")
    # After a double click, the second click must not answer the second question.
    again = (
        f"studio.link.order('study', 'answer', {{turn: {turn}, text: '7'}}).then(() => '', (wrong) => wrong.message)"
    )
    assert "got one to an earlier question" in page.page.evaluate(again)
    assert page.page.locator("#next").is_disabled()
    page.until(HEEDED)  # the slider has the focus: Enter does nothing before it was moved
    page.press("Enter", "ArrowRight", "Enter")
    for _ in range(2):
        page.until("studio.link.state.session.step.kind === 'present' && !studio.link.state.session.busy")
        page.until(HEEDED)
        page.press("Enter")
        page.until("document.querySelector('.participant').innerText.startsWith('It comes now.')")
        page.until("studio.link.state.session.step.kind === 'ask' && !!document.querySelector('#question')", timeout=60)
        page.until(HEEDED)
        page.press("1")
        page.until("studio.link.state.session.step.kind !== 'ask'")
    page.until("studio.link.state.session.step.kind === 'done'")
    events = read_events(study.path / "sessions" / "sub-01.jsonl")
    form = {event["question"]: event["answer"] for event in events if event["event"] == "form"}
    assert form == {"age": "31", "tired": "5.1"}
    opened = next(event for event in events if event["event"] == "open")
    assert (opened["array"], opened["noise_dbfs"], opened["simulated"]) == ("autd3:emulator", None, True)
    assert [event["event"] for event in events].count("presented") == 2
    lines = (studio.state / "played.jsonl").read_text(encoding="utf-8").splitlines()
    [order] = [line for line in map(json.loads, lines) if line["event"] == "play"]
    assert order["exposure"] == "kept"


def test_a_study_of_every_kind_of_stimulus_and_question(studio_at, look, tmp_path):
    """Touch, silence, an object, text, picture, sound and pairs; seven kinds of answers, by keyboard, to the table."""
    Image.new("RGB", (40, 30), "red").save(tmp_path / "photo.png")
    soundfile.write(tmp_path / "noise.wav", np.random.default_rng(1).uniform(-0.01, 0.01, 8000), 8000)
    studio = studio_at()
    text = plan_text()
    design = read_design(text)
    study = StudyFolder.create(
        studio.folder / "kinds",
        text,
        design,
        drives=lambda into: drive_of(into) | prepare_media(design, into, found_in=tmp_path),
    )
    page = look(studio)
    page.until("studio.link.state.player.state === 'ready'", timeout=120)
    begin(page)
    page.page.evaluate("""void (globalThis.media = [],
        studio.link.on('session', session => session?.media && media.push(session.media.kind)))""")
    asked = []
    while (step := page.page.evaluate("studio.link.state.session.step"))["kind"] != "done":
        if step["kind"] == "ask":
            question = step["question"]
            page.until(f"document.querySelector('#question')?.innerText === {json.dumps(question['text'])}")
            asked.append(question["kind"])
            page.until(HEEDED)
            assert not page.page.locator("#jobs").is_visible(), "jobs belong to the experimenter's page"
            if question["kind"] == "slider":
                page.press("ArrowRight", "Enter")
            elif question["answers"]:
                page.press("1")
            else:
                # The field has the focus: typing and Enter are enough.
                page.page.keyboard.type("3")
                page.press("Enter")
        else:
            page.until("!studio.link.state.session.busy && !!document.querySelector('#next')")
            page.until(HEEDED)
            page.page.locator("#next").press("Enter")  # a consent has no focus
        page.until(f"studio.link.state.session.step.turn !== {step['turn']}", timeout=120)
    assert set(asked) == set(QUESTIONS)
    assert {"text", "picture", "sound"} == set(page.page.evaluate("media"))
    table = answers_table(study.plan(), study.sessions())
    # 6 single stimuli x 4 questions, the pair in both orders, and the mixed pair.
    assert table["question"].value_counts().to_dict() == {
        **dict.fromkeys(("yes-no", "slider", "rating", "magnitude"), 6), "choice": 2, "same-different": 1
    }  # fmt: skip
    assert set(table.loc[table["question"] == "slider", "answer"]) == {"51"}
    assert set(table.loc[table["question"] == "choice", "answer"]) == {"first"}


def test_taps_identify_channels_and_the_response_is_shown(studio_at, look):
    page = look(studio_at())
    page.until("studio.link.state.takes?.some((row) => row.name === 'sample:towel')", timeout=120)
    page.go("#calibrate/sample:orbit")
    page.until("document.querySelector('.cells').innerText.includes('this take has no calibration')")
    page.go("#calibrate/sample:towel")
    page.until("!!studio.room?.known")
    assert "no dead channels" in page.page.locator(".card").inner_text()
    page.page.locator("#tap").click()
    page.until("studio.link.state.taps?.state === 'done'", timeout=90)
    assert page.page.evaluate("studio.link.state.taps.channel") == list(range(16))
    assert "Every channel belongs to its cell" in page.page.locator(".left").inner_text()


def test_every_panel_is_accessible_and_fits_every_screen(studio_at, look):
    """Two schemes of colours, a telephone, and 200 % zoom; nothing serious for axe, and each control has its help."""
    page = look(studio_at())
    page.towel()
    assert not page.page.evaluate("studio.room.transport.playing"), "reduced motion begins paused"
    # A sample that is replaced while axe looks at colours disables buttons for a moment.
    page.until("studio.link.state.takes.length > 3 && !document.querySelector('.job')", timeout=240)
    value = page.page.evaluate
    high = "['body > header', '#transport'].reduce((sum, one) => sum + document.querySelector(one).offsetHeight, 0)"
    meters = "[...document.querySelectorAll('.meter')]"

    def small(room, height, bars):
        """Look at what changes on a small screen."""
        if room == "reproduce":
            page.until(f"{high} <= {bars}", timeout=5)  # the parts that stay
            assert page.page.locator("#box-wanted").bounding_box()["y"] < 0.4 * height, "pictures come first"
        if room == "live":
            assert page.page.locator("#live-keep").bounding_box()["height"] < 45, "one line"
        if room == "record":
            page.until(f"{meters}.length === 16 && !!studio.link.state.levels")
            assert not value(f"{meters}.some(one => one.scrollWidth > one.clientWidth)"), "numbers stay in their boxes"
            assert value(f"new Set({meters}.map(one => one.offsetHeight)).size") == 1, "rows of one height"
            assert "rms in V" in page.page.locator("section[aria-label='Level of each cell']").inner_text()

    for room in ROOMS:
        page.go(f"#{room}")
        page.until(f"studio.name === '{room}' && document.querySelector('main').innerText.length > 40")
        page.until("!['reproduce', 'compare'].includes(studio.name) || !!studio.room.take || !!studio.room.name")
        page.page.wait_for_timeout(400)
        for scheme, width, height, bars in SCREENS:
            page.page.emulate_media(color_scheme=scheme)
            page.page.set_viewport_size({"width": width, "height": height})
            wide = ["document.documentElement.scrollWidth"]
            if bars:
                wide += ["document.querySelector('#main').scrollWidth"] * (room not in ("reproduce", "draw", "gallery"))
                small(room, height, bars)
            else:
                assert page.page.locator("#simulated").is_visible()
                assert page.unhelped() == [], room
                assert page.serious() == [], (room, scheme)
            assert max(value(f"[{', '.join(wide)}]")) <= width, (room, width)
    value("document.querySelector('#jobs').innerHTML = '<div class=job>A job</div>'")
    ends = "[document.querySelector('#main').getBoundingClientRect().bottom, document.querySelector('#jobs').offsetTop]"
    content, job = value(ends)
    assert content <= job, "a job covers nothing"
    page.page.set_viewport_size({"width": 640, "height": 400})
    page.go("#reproduce")
    page.until("studio.name === 'reproduce' && !!studio.room.take", timeout=240)  # after the films of the gallery
    for name in ("Edit", "Export", "Play on array", "air not stated"):
        page.page.get_by_role("button", name=name).click()
        assert page.unhelped() == [], name
        page.press("Escape")
    page.page.get_by_label("Solver").focus()
    page.until("document.querySelector('#hint').innerText === 'Method that finds the phases'")
    assert value("document.documentElement.scrollWidth <= innerWidth + 1"), "200 % of 1280 pixels"
