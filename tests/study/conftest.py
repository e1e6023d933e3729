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
