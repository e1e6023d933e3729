from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from midair.errors import InputError
from midair.study import proportion_correct
from midair.study.design.adaptive_block import next_stimulus, scored_history, thresholds_of
from midair.study.design.plan import Staircase, draw_plan, stimulus_levels
from midair.study.design.question import Question, Stimulus
from midair.study.design.session_state import GivenAnswer, SessionState, answers_table, excluded_participants, replay
from midair.study.design.study_design import Block, Design, Exclusions, Extra
from midair.study.findings.analysis import analyse
from midair.study.findings.study_data import data_of_answers
from midair.study.session.event_log import read_events
from midair.study.session.participant import SimulatedParticipant, SimulatedScreen
from midair.study.session.presenters import SilentPresenter
from midair.study.session.trials import Session, run

STRENGTHS = [0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0]


def design(adaptive, trials=60, strengths=STRENGTHS, sides=("left", "right")):
    stimuli = tuple(
        Stimulus(name=f"s{s}{place}", source="x", levels={"strength": str(s), "place": place})
        for s in strengths
        for place in sides
    )
    question = Question(name="where", kind="choice", text="?", options=("left", "right"), truth="place")
    names, how = tuple(one.name for one in reversed(stimuli)), {"adaptive": adaptive, "strength": "strength"}
    block = Block(name="b", stimuli=names, questions=("where",), repetitions=trials, **how)
    return Design(name="ladder", participants=8, seed=2, stimuli=stimuli, questions=(question,), blocks=(block,))


def session(plan, number, path, stop_after=None):
    presenter = SilentPresenter()
    person = SimulatedParticipant(d_prime=1.0, spread=0, taste=0, lapse=0, seed=number)
    screen = SimulatedScreen(plan=plan, participant=person, presenter=presenter)
    with Session(plan, number, path, presenter, simulated=True) as one:
        while one.step.kind != "done" and stop_after != 0:
            if one.step.kind == "ask" and stop_after is not None:
                stop_after -= 1
            if one.step.kind == "show":
                one.acknowledge()
            else:
                one.present() if one.step.kind == "present" else one.answer(screen.ask(one.step))
        if stop_after is None:
            assert run(one, screen).kind == "done"
    return replay(read_events(path), plan, number)


@pytest.mark.long
def test_finds_the_threshold_of_a_known_observer(tmp_path):
    for adaptive in ("staircase", "quest+"):
        plan = draw_plan(design(adaptive, trials=120))
        table = thresholds_of(plan, [session(plan, n, tmp_path / f"{adaptive}{n}") for n in range(1, 9)])
        right = float(proportion_correct(np.exp(np.log(table["threshold"]).mean()), alternatives=2))
        assert right == pytest.approx(0.75, abs=0.07), adaptive


@pytest.mark.long
def test_levels_go_down_after_three_correct_and_up_after_one_wrong(tmp_path):
    plan = draw_plan(design("staircase"))
    progress = session(plan, 1, tmp_path / "log")
    ladder, strength = stimulus_levels(plan.design, plan.design.block("b"))
    assert strength.tolist() == STRENGTHS
    history = scored_history(plan, progress, plan.design.block("b"))
    assert len(history) == 60
    assert [len(names) for names in ladder] == [2] * 9
    place = [rung for rung, _ in history]
    assert place[:3] == [8, 8, 8]
    for before, after, (_, right) in zip(place, place[1:], history, strict=False):
        assert after >= before if not right else after <= before


def test_an_interrupted_staircase_continues_unchanged(tmp_path):
    plan = draw_plan(design("staircase", trials=30))
    session(plan, 3, tmp_path / "a", stop_after=11)
    first = session(plan, 3, tmp_path / "a")
    whole = session(plan, 3, tmp_path / "b")
    assert first.chosen == whole.chosen
    assert answers_table(plan, [first])["stimulus"].tolist() == answers_table(plan, [whole])["stimulus"].tolist()
    assert set(answers_table(plan, [whole])["correct"].tolist()) == {0, 1}


def test_levels_that_do_not_do_or_reveal_the_answer_are_refused():
    for how, drop, why in [
        ({"strengths": [0, 1, 2]}, "", "strengths above 0"),
        ({"strengths": [1, 2]}, "", "three strengths or more"),
        ({"sides": ("left",)}, "", "'left' in all"),
        ({}, "s1.0left", "same correct answers at every strength"),
    ]:
        made = design("quest+", **how)
        (block,) = made.blocks
        kept = tuple(name for name in block.stimuli if name != drop)
        with pytest.raises(InputError, match=why):
            draw_plan(replace(made, blocks=(replace(block, stimuli=kept),)))


@pytest.mark.parametrize("people", [20, pytest.param(500, marks=pytest.mark.long)])
def test_constant_answers_are_correct_by_chance(people):
    for adaptive in ("staircase", "quest+"):
        plan, right = draw_plan(replace(design(adaptive, trials=20, strengths=[0.5, 1, 2]), participants=people)), []
        for number in range(1, people + 1):
            standing = with_answers(plan, number, "left")
            right.append(np.mean([correct for _, correct in scored_history(plan, standing, plan.design.blocks[0])]))
        assert np.mean(right) == 0.5, adaptive
        assert {trial.variant for trial in plan.trials} == {0, 1}, adaptive


@pytest.mark.long
def test_the_next_side_is_independent_of_the_previous_one():
    plan = draw_plan(replace(design("quest+", trials=40), participants=100))
    sides = np.array([[trial.variant for trial in plan.of(number)] for number in range(1, 101)])
    assert (sides.sum(axis=1) == 20).all()
    # Of 40 balanced places a side follows itself in 19 of 39 on average.
    assert np.mean(sides[:, 1:] == sides[:, :-1]) == pytest.approx(19 / 39, abs=0.03)


@pytest.mark.long
def test_catch_trials_do_not_change_the_threshold(tmp_path):
    made = design("quest+", sides=("yes",))
    felt = Question(name="where", kind="yes-no", text="Felt?")
    nothing = Stimulus(name="nothing", kind="silence")
    extras = (Extra(role="catch", stimuli=("nothing",), repetitions=15),)
    block = replace(made.blocks[0], extras=extras)
    plan = draw_plan(replace(made, stimuli=(*made.stimuli, nothing), questions=(felt,), blocks=(block,)))
    trials = plan.of(1)
    assert ([trial.role for trial in trials].count("catch"), trials[0].role) == (15, "test")
    progress = session(plan, 1, tmp_path / "log")
    assert len(scored_history(plan, progress, plan.design.blocks[0])) == 60
    table = answers_table(plan, [progress])
    assert set(table.loc[table["role"] == "catch", "right"]) == {"no"}
    assert table["scored"].all(), "of d' they are the half in which nothing is felt"


def test_levels_of_constant_stimuli_have_thresholds_and_a_short_staircase_has_none(tmp_path):
    made = design("", trials=12)
    plan = draw_plan(made)
    assert all(trial.stimulus for trial in plan.trials)
    table = thresholds_of(plan, [session(plan, 1, tmp_path / "log")])
    assert table["method"].tolist() == ["constant"]
    assert table["trials"][0] == 12 * 18
    assert STRENGTHS[0] < table["threshold"][0] < STRENGTHS[-1]
    plan = draw_plan(design("staircase", trials=4))
    table = thresholds_of(plan, [session(plan, 1, tmp_path / "short")])
    assert np.isnan(table["threshold"][0])
    assert table["note"][0].startswith("refused: ")


def with_answers(plan, number, answer, **how):
    """A finished session with the same answer and timing in all trials."""
    answers, chosen = {}, {}
    standing = SessionState(trials=plan.of(number), answers=answers, chosen=chosen)
    for trial in standing.trials:
        chosen[trial.code] = trial.stimulus or next_stimulus(plan, standing, trial)
        given = {"reaction_s": 1.0, "time": "2026-11-22T13:26:06+00:00"} | how
        answers[trial.code, "where"] = GivenAnswer(answer=answer, **given)
    return standing


@pytest.mark.long
def test_thresholds_obey_the_rules_of_the_plan(tmp_path):
    """Thresholds use the scored rows of the answers table, whatever the rule that excludes an answer."""
    rules = Exclusions(fastest_s=0.2, timeouts=0.5, unfinished=True)
    plan = draw_plan(replace(design("quest+", trials=120), exclusions=rules))
    whole = session(plan, 1, tmp_path / "1")
    begun = session(plan, 6, tmp_path / "6")
    late = session(plan, 7, tmp_path / "7")
    some_late = {key: replace(given, answer="n/a", late=True) for key, given in list(late.answers.items())[::4]}
    sessions = [
        whole,
        replace(whole, trials=plan.of(2), answers={}, chosen={}),
        replace(begun, answers=dict(list(begun.answers.items())[:7])),
        with_answers(plan, 4, "left", reaction_s=0.05),
        with_answers(plan, 5, "n/a", late=True),
        replace(late, answers=late.answers | some_late),
    ]
    table = thresholds_of(plan, sessions)
    assert np.isfinite(table["threshold"]).tolist() == [True, False, False, False, False, True]
    assert table["trials"].tolist() == [120, 0, 0, 0, 0, 90], "a time-out is no wrong answer"
    for note, why in zip(table["note"][1:5], ("unfinished", "unfinished", "all 120", "timeouts"), strict=True):
        assert why in note
    answers = answers_table(plan, sessions)
    scored = answers[answers["scored"]]
    assert table.set_index("participant")["trials"][["sub-01", "sub-07"]].tolist() == [
        (scored["participant"] == who).sum() for who in ("sub-01", "sub-07")
    ]
    data = data_of_answers(answers, plan.design.analysis, thresholds=table)
    found = {one.title: one.words for one in analyse(data, draws=20).findings}
    assert found["Participants"].startswith("SIMULATED: no person was asked. 2 participants, 210 answers")
    assert found["Thresholds of adaptive blocks"].startswith("Median of 2 thresholds")
    assert excluded_participants(plan, sessions)[["participant", "rule"]].values.tolist() == [
        ["sub-02", "unfinished"],
        ["sub-06", "unfinished"],
        ["sub-05", "timeouts"],
    ]


def test_staircase_by_hand_and_within_its_levels():
    state = Staircase(level=10, steps=(4, 2, 1))
    seen = []
    for correct in (1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0, 0):
        state = state.answered(bool(correct))
        seen.append(state.level)
    #        down after 3    after 6, up 2 (first turn)   down 1     up 1  up 1
    assert (seen, state.turned) == ([10, 10, 6, 6, 6, 2, 4, 4, 4, 3, 4, 5], (2, 4, 3))
    assert Staircase(level=1, steps=(5,), low=0, high=3).answered(False).level == 3


def test_staircase_converges_to_79_percent_correct():
    rng = np.random.default_rng(0)
    found = []
    for _ in range(40):
        state = Staircase(level=2, steps=(0.5, 0.2, 0.1))
        while len(state.turned) < 24:
            state = state.answered(rng.random() < ndtr(state.level))
        found.append(np.mean(state.turned[-20:]))
    assert np.mean(ndtr(found)) == pytest.approx(0.5 ** (1 / 3), abs=0.02)
