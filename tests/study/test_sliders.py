from pathlib import Path

import pytest
from tests.study.simulated import simulate

from midair.study.design.session_state import answers_table
from midair.study.findings.analysis import analyse
from midair.study.folder import StudyFolder, data_of_study, read_design
from midair.study.session.participant import SimulatedParticipant

PLAN = Path(__file__).with_name("plans").joinpath("visual.toml").read_text(encoding="utf-8")


@pytest.mark.long
def test_sliders_have_the_analysis_of_variance_of_their_unrounded_answers(tmp_path):
    from scipy.stats import ttest_rel

    folder = StudyFolder.create(tmp_path / "s", PLAN, read_design(PLAN))
    plan = simulate(folder, SimulatedParticipant(rating_effect=10, rating_noise=5))
    answers = answers_table(plan, folder.sessions())
    given = answers["answer"].astype(float)
    assert (given % 1).any()
    assert given.between(0, 100).all()
    report = analyse(data_of_study(folder), seed=1, draws=100)
    table = next(one.table for one in report.findings if one.table is not None and "p_GG" in one.table)
    means = given.groupby([answers["participant"], answers["object"]]).mean().unstack()
    # With two levels, F is the square of the paired t.
    assert table.set_index("effect").loc["object", "F"] == pytest.approx(
        ttest_rel(means["towel"], means["glass"]).statistic ** 2
    )
