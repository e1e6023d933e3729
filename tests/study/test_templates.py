from typing import get_args

import numpy as np
import pytest
from tests.study.simulated import simulate

from midair.study.design.adaptive_block import thresholds_of
from midair.study.design.plan import draw_plan
from midair.study.design.session_state import answers_table, excluded_participants
from midair.study.drives import prepare_drives
from midair.study.findings.analysis import analyse
from midair.study.findings.study_data import data_of_answers
from midair.study.folder import StudyFolder, Template, read_design, template_text
from midair.study.session.participant import SimulatedParticipant

PEOPLE = 6


@pytest.fixture(scope="module", params=get_args(Template))
def done(request, tmp_path_factory):
    """A template after the sessions of six simulated people who meet all criteria."""
    text = template_text(request.param)
    folder = StudyFolder.create(tmp_path_factory.mktemp("t") / "s", text, read_design(text, participants=PEOPLE))
    plan = simulate(folder, SimulatedParticipant(spread=0, taste=0))
    return request.param, plan, folder.sessions()


@pytest.mark.long
def test_every_template_goes_from_plan_to_report(done):
    template, plan, sessions = done
    assert excluded_participants(plan, sessions).empty
    table = answers_table(plan, sessions)
    assert set(table["hand"]) == {"left", "right", "both"}
    assert "pseudonym" not in table
    data = data_of_answers(table, plan.design.analysis, thresholds=thresholds_of(plan, sessions))
    said = [finding.words for finding in analyse(data, draws=50).findings]
    assert said
    assert not [words for words in said if words.startswith("Not computed")]
    if template not in ("detection", "intervals"):
        return
    # Training ends, and thresholds are those of the observer.
    assert all(session.waived and not session.untrained for session in sessions)
    found = np.exp(np.log(thresholds_of(plan, sessions)["threshold"]).mean())
    # d' is 1.2 at the middle of the ladder and rises with the strength; 75 % of two intervals are right at .95.
    middle = {"detection": 10, "intervals": 20}[template]
    assert found == pytest.approx(middle * 0.95 / 1.2, rel=0.4)


def test_every_template_drive_has_a_virtual_source_and_who_feels_nothing_a_threshold():
    """Rules on right answers left out the insensitive: of six people the median of three."""
    design = read_design(template_text("detection"))
    assert (design.exclusions.attention, design.exclusions.training) == (0.0, False)
    for template in get_args(Template):
        design = read_design(template_text(template))
        sources = {one.source for one in design.stimuli if one.kind == "drive"}
        assert {one.source for one in design.stimuli if one.made_from} == sources


def test_all_orders_of_a_pair_come_equally_often():
    for template in ("detection", "intervals", "paired"):
        plan = draw_plan(read_design(template_text(template), participants=PEOPLE))
        for number in range(1, PEOPLE + 1):
            tests = [trial for trial in plan.of(number) if trial.role == "test" and trial.scored]
            if template == "paired":
                first = [trial.levels["grooved_came"] for trial in tests]
                assert first.count("first") == first.count("second") == 12
            else:
                assert sum(trial.variant for trial in tests) == len(tests) / 2, template


@pytest.mark.long
def test_the_threshold_vibration_is_solved(tmp_path):
    plan = draw_plan(read_design(template_text("detection")))
    (made,) = prepare_drives(plan.design, tmp_path, found_in=None)
    assert made.how == "virtual"
    assert 0.5 < made.duration < 1.5
