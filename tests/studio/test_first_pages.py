"""The first page and the panel Gallery in a real browser: ways to a touch, pictures, film, sound, accessibility."""

import pytest

from midair.datasets import TOUCHES
from midair.files import load
from midair.patterns import load_pattern

pytestmark = pytest.mark.browser


def test_three_doors_lead_to_a_touch_and_those_of_the_gallery_are_seen_heard_and_used(studio_at, look, tmp_path):
    page = look(studio := studio_at(), at="")
    page.until("studio.name === 'start' && document.querySelectorAll('.recent li').length === 4")
    assert len(list(page.shown("start", tmp_path, ("dark", 1400), ("light", 390)))) == 2
    for words, room in (("Start drawing", "draw"), ("Record a touch", "record"), ("Choose a touch", "gallery")):
        page.go("#start")
        page.until("studio.name === 'start'")
        page.page.get_by_role("link", name=words).click()
        page.until(f"studio.name === '{room}'")
    solved = page.page.evaluate("studio.link.state.takes.filter(take => take.solved).map(take => take.name)")
    assert solved == ["sample:orbit"], "nothing is solved unasked"
    page.until("studio.room.ready", timeout=120)
    labels = page.page.locator(".card-touch canvas").evaluate_all("(all) => all.map((one) => one.ariaLabel)")
    assert [label.partition(":")[0] for label in labels] == list(TOUCHES)
    assert all("rms pressure on" in label for label in labels)
    towel = page.page.locator("#touch-towel").inner_text()
    assert f"felt by {TOUCHES['towel'].felt} of 10" in towel
    assert f"ears: {TOUCHES['towel'].ears} dB too loud without protection" in towel
    lit = "[...document.querySelector('#touch-rain canvas').getContext('2d').getImageData(0, 0, 280, 372).data]"
    picture = page.page.evaluate(f"{lit}.join()")
    page.page.get_by_role("button", name="film of rain").click()
    page.until(f"{lit}.join() !== {picture!r}")
    page.until(f"{lit}.join() === {picture!r}")  # the film has ended
    page.page.get_by_role("button", name="sound of rain").click()
    assert page.until("studio.room.heard") == pytest.approx(1, abs=0.02)
    for scheme in page.shown("gallery", tmp_path, ("dark", 1280), ("light", 390)):
        page.until(f"({lit}.join() === {picture!r}) === {'true' if scheme == 'light' else 'false'}")
    page.page.get_by_role("button", name="use heartbeat").click()
    page.until("studio.name === 'draw' && studio.room.pattern.name === 'heartbeat'")
    assert load_pattern(studio.folder / "heartbeat.toml").foci().frames > 0
    page.go("#gallery")
    page.page.get_by_role("button", name="use ridges").press("Enter")
    page.until("studio.room?.take?.name === 'ridges.h5'")
    assert load(studio.folder / "ridges.h5").provenance.notes["licence"] == "MIT"
