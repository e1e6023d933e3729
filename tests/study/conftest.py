import pytest
from tests.study.simulated import simulate

from midair.study.design.session_state import answers_table
from midair.study.folder import StudyFolder, read_design, template_text


@pytest.fixture(scope="session")
def small_study(tmp_path_factory):
    """Plan and answers of two simulated people."""
    text = template_text("paper").replace("repetitions = 4", "repetitions = 1")
    folder = StudyFolder.create(
        tmp_path_factory.mktemp("study") / "s", text, read_design(text, name="small", participants=2)
    )
    plan = simulate(folder)
    return plan, answers_table(plan, folder.sessions())


@pytest.fixture
def overflowing(chromium):
    """HTML of the elements that leave a page of some width, or that scroll although they may be wide."""

    def find(html, width, **media):
        page = chromium.new_page(viewport={"width": width, "height": 900})
        page.emulate_media(**media)
        page.set_content(html)
        beyond = page.evaluate(
            """() => [...document.querySelectorAll("body *")].filter(one =>
                one.getBoundingClientRect().right > document.documentElement.clientWidth + 1
                || (one.classList.contains("wide") && one.scrollWidth > one.clientWidth + 1))
                .map(one => one.outerHTML)"""
        )
        page.close()
        return beyond

    return find
