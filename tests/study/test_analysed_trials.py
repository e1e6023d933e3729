"""Report, Python and export analyse the same trials, whatever excludes the others."""

import json

import pytest

from midair.cli.commands.study import study_app
from midair.study import (
    InstantClock,
    Reply,
    Session,
    SilentPresenter,
    StudyFolder,
    answers_table,
    read_bids,
    read_csv,
    read_design,
)
from midair.study.design.adaptive_block import thresholds_of
from midair.study.folder import data_of_study

PLAN = """
name = "felt"
participants = 8
seed = 3
[exclusions]
fastest_s = 0.2
slowest_s = 8
catch = 0.6
timeouts = 0.5
unfinished = true
[[questions]]
name = "felt"
kind = "yes-no"
text = "Felt?"
timeout_s = 10
[[stimuli]]
name = "nothing"
kind = "silence"
""" + "".join(
    f'[[stimuli]]\nname = "s{n}"\nsource = "v.drive.h5"\nlevels = {{ percent = "{n}" }}\n' for n in (1, 3, 10, 30, 100)
)
BLOCK = """
[[blocks]]
name = "threshold"
stimuli = ["s1", "s3", "s10", "s30", "s100"]
questions = ["felt"]
repetitions = 40
adaptive = "quest+"
strength = "percent"
extras = [
  { role = "catch", stimuli = ["nothing"], repetitions = 6 },
  { role = "attention", stimuli = ["s100"], repetitions = 4 },
]
"""


def replies(number, count, percent):
    """Answer of each simulated person: 2 opens only, 3 ends early, 4 is too fast, 5 too late, 6 always says yes."""
    felt = "yes" if percent >= 10 or number == 6 else "no"
    if number == 4:
        return Reply(text=felt, reaction_s=0.05, by="key")
    late = number == 5 or (number == 7 and count % 9 == 0)
    slow = 9.0 if number == 8 and count % 7 == 0 else 1.0
    return Reply(text=felt, reaction_s=20.0 if late else slow, by="key", late=late)


def trials(table):
    scored = table[table["scored"].astype(bool)]
    return sorted(zip(scored["participant"].tolist(), scored["trial"].astype(int).tolist(), strict=True))


@pytest.mark.long
def test_every_output_has_the_same_trials(tmp_path, capsys):
    folder = StudyFolder.create(tmp_path / "felt", PLAN + BLOCK, read_design(PLAN + BLOCK))
    plan = folder.plan()
    for number in range(1, 9):
        presenter, count = SilentPresenter(), 0
        with Session(plan, number, folder.log(number), presenter, simulated=True, clock=InstantClock()) as session:
            while session.step.kind != "done" and not (number == 2 or (number == 3 and count == 20)):
                if session.step.kind == "present":
                    session.present()
                    continue
                count += 1
                percent = float(plan.design.stimulus(presenter.felt[-1]).levels.get("percent", 0))
                session.answer(replies(number, count, percent))
    sessions = folder.sessions()
    analysed = trials(answers_table(plan, sessions))
    people = {who for who, _ in analysed}
    assert people == {"sub-01", "sub-07", "sub-08"}
    study_app(["analyse", str(folder.path), "--draws", "20", "--json"], result_action="return_value")
    report = {one["title"]: one for one in json.loads(capsys.readouterr().out)["findings"]}
    assert f"3 participants, {len(analysed)} answers analysed" in report["Participants"]["words"]
    rows = report["Thresholds of adaptive blocks"]["table"]
    counts = {row["participant"]: row["trials"] for row in rows}
    assert {who for who, many in counts.items() if many} == people
    assert {row["participant"] for row in rows if row["threshold"] is not None} == people
    assert all(row["note"] for row in rows if row["participant"] not in people)
    assert [counts[who] for who in sorted(people)] == [50, 45, 43]

    assert data_of_study(folder).thresholds.equals(thresholds_of(plan, sessions))
    for kind, read in (("csv", read_csv), ("bids", read_bids)):
        study_app(["export", str(folder.path), str(tmp_path / kind), "--format", kind], result_action="return_value")
        assert trials(read(tmp_path / kind)) == analysed
    # The fit finds the step of a consistent person.
    table = thresholds_of(plan, sessions).dropna(subset="threshold")
    assert ((table["threshold"] > 3) & (table["threshold"] < 10) & (table["low"] < table["threshold"])).all()
