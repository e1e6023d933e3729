"""The first page in a real browser: three ways to a touch, accessibility."""

import os

import numpy as np
import pytest
import soundfile
from axe_playwright_python.sync_playwright import Axe

pytestmark = pytest.mark.browser


def test_three_doors_lead_to_a_touch_and_nothing_is_solved_unasked(studio_at, look, tmp_path):
    soundfile.write(tmp_path / "wool.wav", 0.5 * np.sin(2 * np.pi * 150 * np.arange(8000) / 8000), 8000)
    studio = studio_at()
    page = look(studio, at="")
    page.until("studio.name === 'start' && document.querySelectorAll('.recent li').length === 4")
    for scheme, width in (("dark", 1400), ("light", 390)):
        page.page.emulate_media(color_scheme=scheme)
        page.page.set_viewport_size({"width": width, "height": 900})
        page.page.screenshot(path=f"{os.environ.get('MIDAIR_PICTURES', tmp_path)}/start-{scheme}-{width}.png")
        assert page.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert Axe().run(page.page).response["violations"] == []
    for words, room in (("Choose a touch", "gallery"), ("Start drawing", "draw"), ("Record a touch", "record")):
        page.page.get_by_role("link", name=words).click()
        page.until(f"studio.name === '{room}'")
        page.go("#start")
        page.until("studio.name === 'start'")
    assert page.page.evaluate("studio.link.state.takes.filter(take => take.solved).map(take => take.name)") == [
        "sample:orbit"
    ]
    page.page.locator("input[type=file]").set_input_files(tmp_path / "wool.wav")
    page.until("document.querySelector('#import-said polygon')", timeout=60)
    page.page.get_by_role("button", name="Import").click()
    page.until("studio.room?.take?.name === 'wool.h5'", timeout=60)
    assert page.wrong == []
