"""The rooms in a real browser: Calibrate, Study, Record's warnings; and that everybody can use all of them."""

import json

import pytest
from axe_playwright_python.sync_playwright import Axe

from midair.study import StudyFolder, read_design, read_events

pytestmark = pytest.mark.browser

DESIGN = """
name = "three"
title = "Three objects"
participants = 2
seed = 4
consent = "You will feel things. You may stop at any time."

[[questions]]
name = "closest"
kind = "choice"
text = "Which object was it?"
options = ["brush", "sponge", "towel"]
truth = "object"

[[stimuli]]
name = "a"
kind = "object"
source = "brush"
levels = { object = "brush" }

[[stimuli]]
name = "b"
kind = "object"
source = "sponge"
levels = { object = "sponge" }

[[stimuli]]
name = "c"
kind = "object"
source = "towel"
levels = { object = "towel" }

[[blocks]]
name = "one"
text = "Say each time which it was."
stimuli = ["a", "b", "c"]
questions = ["closest"]
repetitions = 9
"""

PRESENTS = """void studio.link.on('session', session =>
    session?.due && studio.link.order('study', 'presented').catch(() => {}))"""
"""The experimenter presents as soon as the page says what. Void: Playwright calls what a script gives."""

ROOMS = ("record", "calibrate", "reproduce", "compare", "study", "live")


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
    """So many trials by the keyboard alone."""
    for _ in range(count):
        page.until("!!document.querySelector('#next') && studio.link.state.session.step.kind === 'present'")
        page.page.keyboard.press("Enter")
        page.until("studio.link.state.session.step.kind === 'ask' && !!document.querySelector('#question')")
        number = page.page.evaluate("studio.link.state.session.step.number")
        page.page.keyboard.press("2")
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
            page.page.keyboard.press("Enter")
            page.until(f"studio.link.state.session.step.text !== {json.dumps(shown)}")


def test_a_study_of_27_trials_by_keyboard_survives_a_reload_and_a_kill(study, studio_at, look):
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
    again = studio_at()
    again.folder.rmdir()
    studio.folder.rename(again.folder)
    second = look(again)
    begin(second)
    texts(second)
    trials(second, 22)
    second.until("studio.link.state.session.step.kind === 'done'")
    kept = answers(StudyFolder(again.folder / "three"))
    assert len(kept) == 27
    assert {event["answer"] for event in kept} == {"sponge"}
    assert second.wrong == []


def test_a_pilot_is_seen_as_one_and_stored_apart_and_who_wants_to_stop_is_stopped(study, look):
    studio, study = study
    page = look(studio)
    begin(page, pilot=True)
    assert page.page.evaluate("document.body.classList.contains('pilot')")
    assert "PILOT" in page.page.locator("#transport").inner_text()
    texts(page)
    trials(page, 1)
    assert not (study.path / "sessions" / "sub-01.jsonl").exists()
    assert len(answers(study, "pilot")) == 1
    page.page.keyboard.press("Escape")
    page.until("studio.link.state.session.step.kind === 'stopped'")
    events = read_events(study.path / "pilot" / "sub-01.jsonl")
    assert events[-1]["event"] == "stop"
    assert next(event for event in events if event["event"] == "open")["pilot"] is True


def test_taps_tell_which_channel_is_which_cell_and_a_response_is_shown(studio_at, look):
    page = look(studio_at())
    page.until("studio.link.state.takes?.length > 0", timeout=120)
    page.go("#calibrate")
    page.until("!!studio.room?.known")
    assert "no dead channels" in page.page.locator(".card").inner_text()
    page.page.locator("#tap").click()
    page.until("studio.link.state.taps?.state === 'done'", timeout=90)
    assert page.page.evaluate("studio.link.state.taps.channel") == list(range(16))
    assert "Every channel is in its place" in page.page.locator(".left").inner_text()
    assert page.wrong == []


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_everybody_can_use_every_room(studio_at, look, scheme):
    """No serious finding of axe; nothing empty; SIMULATED is to be seen; nothing is cut off at the side."""
    page = look(studio_at(), color_scheme=scheme, reduced_motion="reduce")
    page.until("!!studio.room?.played && studio.room.take.played.last > 0", timeout=120)
    assert not page.page.evaluate("studio.room.transport.playing"), "reduced motion begins paused"
    serious = {}
    for room in ROOMS:
        page.go(f"#{room}")
        page.until(f"studio.name === '{room}' && document.querySelector('main').innerText.length > 40")
        page.page.wait_for_timeout(400)
        assert page.page.locator("#simulated").is_visible()
        assert page.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), room
        found = Axe().run(page.page).response["violations"]
        wrong = [
            (each["id"], each["nodes"][0]["html"][:120]) for each in found if each["impact"] in ("serious", "critical")
        ]
        if wrong:
            serious[room] = wrong
    assert serious == {}
    page.page.set_viewport_size({"width": 640, "height": 400})
    page.go("#reproduce")
    page.until("studio.name === 'reproduce'")
    assert page.page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1"), "200 % of 1280 pixels"
    assert page.wrong == []


def test_an_address_that_was_typed_is_not_taken_back(studio_at, look):
    """A room tells its time in the address as often as it draws, also in the instant in which another is asked for."""
    page = look(studio_at())
    page.until("!!studio.room?.take")
    page.page.evaluate("location.hash = '#record'; studio.here('sample:towel', 0.5)")
    page.until("studio.name === 'record'", timeout=20)


def test_reproduce_by_tab_and_arrows(studio_at, look):
    page = look(studio_at(), reduced_motion="reduce")
    page.until("!!studio.room?.played && studio.room.take.played.last > 0", timeout=120)
    names = []
    for _ in range(60):
        page.page.keyboard.press("Tab")
        names.append(
            page.page.evaluate(
                "document.activeElement.getAttribute('aria-label') ?? document.activeElement.innerText ?? ''"
            )
        )
        if names[-1].startswith("The whole take"):
            break
    for wanted in ("STOP", "Solve", "Wanted sound", "Played sound", "Cells"):
        assert any(wanted in name for name in names), (wanted, names)
    before = page.page.evaluate("studio.room.transport.frame")
    page.page.keyboard.press("ArrowRight")
    assert page.page.evaluate("studio.room.transport.frame") == before + 1
    page.page.get_by_label("Wanted sound").focus()
    page.page.keyboard.press("ArrowRight")
    page.until(
        "[...document.querySelectorAll('#box-wanted .view-said')].some(each => each.textContent.includes('Pa at'))"
    )
