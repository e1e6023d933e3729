import numpy as np
import pytest

from midair.study import d_prime_same_different, d_prime_yes_no, proportion_correct
from midair.study.design.plan import draw_plan
from midair.study.design.question import Question, Stimulus
from midair.study.design.study_design import Block, Design
from midair.study.session.participant import SimulatedParticipant

OBJECTS = ("brush", "sponge", "towel")


def answers(person, question, stimuli, presented=None, participants=20, repetitions=40):
    """Trials of a plan, the answers of a person, and the plan."""
    names = tuple(presented or (one.name for one in stimuli))
    block = Block(name="b", stimuli=names, questions=(question.name,), repetitions=repetitions)
    how = {"name": "try", "participants": participants, "seed": 3, "stimuli": stimuli, "questions": (question,)}
    drawn = draw_plan(Design(**how, blocks=(block,)))
    return [(trial, person.answer(drawn, trial, question.name)[0]) for trial in drawn.trials], drawn


WHICH = Question(name="q", kind="choice", text="?", options=OBJECTS, truth="object")
THINGS = tuple(Stimulus(name=o, source="x", levels={"object": o}) for o in OBJECTS)
TWO = tuple(Stimulus(name=name, source=name) for name in "ab")
NOTHING = Stimulus(name="n", kind="silence")
PAIRS = tuple(Stimulus(name=f"a{name}", kind="pair", members=("a", name)) for name in "ab")


@pytest.mark.long
def test_answers_have_the_stated_sensitivity():
    given, _ = answers(SimulatedParticipant(d_prime=1.0, spread=0, taste=0, lapse=0), WHICH, THINGS)
    share = np.mean([answer == trial.levels["object"] for trial, answer in given])
    assert share == pytest.approx(float(proportion_correct(1.0, alternatives=3)), abs=0.03)
    for kind, stimuli, presented, yes, measure, d_prime, within in [
        ("yes-no", (TWO[0], NOTHING), "an", "yes", d_prime_yes_no, 1.5, 0.2),
        ("same-different", (*TWO, *PAIRS), ("ab", "aa"), "different", d_prime_same_different, 2.5, 0.3),
    ]:
        person = SimulatedParticipant(d_prime=d_prime, spread=0, lapse=0)
        given, _ = answers(person, Question(name="q", kind=kind, text="?"), stimuli, presented)
        hits, alarms = (sum(said == yes for trial, said in given if trial.stimulus == one) for one in presented)
        assert measure(hits, 800, alarms, 800).d_prime == pytest.approx(d_prime, abs=within)


@pytest.mark.long
def test_ratings_and_magnitudes_are_answers():
    rating = Question(name="q", kind="rating", text="?", levels={"rated": "towel"})
    given, _ = answers(SimulatedParticipant(rating_effect=2.0), rating, THINGS, repetitions=10)
    assert all(rating.read(answer) == answer for _, answer in given)
    match, other = (np.mean([int(answer) for trial, answer in given if (trial.stimulus == "towel") is is_it])
                    for is_it in (True, False))  # fmt: skip
    assert match - other == pytest.approx(2.0, abs=0.3)
    magnitude = Question(name="q", kind="magnitude", text="?")
    given, _ = answers(SimulatedParticipant(magnitude=20), magnitude, THINGS, repetitions=10)
    assert np.median([float(magnitude.read(answer)) for _, answer in given]) == pytest.approx(20, rel=0.3)


def test_an_answer_is_independent_of_earlier_ones():
    few = {"participants": 2, "repetitions": 5}
    once, drawn = answers(SimulatedParticipant(seed=4), WHICH, THINGS, **few)
    backwards = [SimulatedParticipant(seed=4).answer(drawn, trial, "q")[0] for trial, _ in reversed(once)]
    assert backwards[::-1] == [answer for _, answer in once]
    assert answers(SimulatedParticipant(seed=5), WHICH, THINGS, **few)[0] != once
