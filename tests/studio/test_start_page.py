"""The first page in a real browser: three ways to a touch, accessibility."""

import pytest

pytestmark = pytest.mark.browser


def test_three_doors_lead_to_a_touch_and_nothing_is_solved_unasked(studio_at, look, tmp_path):
    studio = studio_at()
    page = look(studio, at="")
    page.until("studio.name === 'start' && document.querySelectorAll('.recent li').length === 4")
    assert len(list(page.shown("start", tmp_path, ("dark", 1400), ("light", 390)))) == 2
    for words, room in (("Choose a touch", "gallery"), ("Start drawing", "draw"), ("Record a touch", "record")):
        page.page.get_by_role("link", name=words).click()
        page.until(f"studio.name === '{room}'")
        page.go("#start")
        page.until("studio.name === 'start'")
    assert page.page.evaluate("studio.link.state.takes.filter(take => take.solved).map(take => take.name)") == [
        "sample:orbit"
    ]
    assert page.wrong == []
