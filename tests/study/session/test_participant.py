import numpy as np
import pytest

from midair.study import d_prime_same_different, d_prime_yes_no, proportion_correct
from midair.study.design.plan import draw_plan
from midair.study.design.question import Question, Stimulus
from midair.study.design.study_design import Block, Design
from midair.study.session.participant import SimulatedParticipant

OBJECTS = ("brush", "sponge", "towel")


def plan(question, stimuli, participants=20, repetitions=40):
    block = Block(name="b", stimuli=tuple(s.name for s in stimuli), questions=(question.name,), repetitions=repetitions)
    return draw_plan(
        Design(name="try", participants=participants, seed=3, stimuli=stimuli, questions=(question,), blocks=(block,))
    )


def answers(person, drawn, question):
    return [(trial, person.answer(drawn, trial, question.name)[0]) for trial in drawn.trials]


@pytest.mark.long
def test_choices_have_the_stated_sensitivity():
    question = Question(name="q", kind="choice", text="?", options=OBJECTS, truth="object")
    stimuli = tuple(Stimulus(name=o, source="x", levels={"object": o}) for o in OBJECTS)
    person = SimulatedParticipant(d_prime=1.0, spread=0, taste=0, lapse=0)
    given = answers(person, plan(question, stimuli), question)
    share = np.mean([answer == trial.levels["object"] for trial, answer in given])
    assert share == pytest.approx(float(proportion_correct(1.0, alternatives=3)), abs=0.03)


TWO = tuple(Stimulus(name=name, source=name) for name in "ab")
NOTHING = Stimulus(name="n", kind="silence")
PAIRS = tuple(Stimulus(name=f"a{name}", kind="pair", members=("a", name)) for name in "ab")


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "stimuli", "presented", "yes", "measure", "d_prime"),
    [
        ("yes-no", (TWO[0], NOTHING), "an", "yes", d_prime_yes_no, 1.5),
        ("same-different", (*TWO, *PAIRS), ("ab", "aa"), "different", d_prime_same_different, 2.5),
    ],
)
def test_two_answers_have_the_stated_sensitivity(kind, stimuli, presented, yes, measure, d_prime):
    question = Question(name="q", kind=kind, text="?")
    block = Block(name="b", stimuli=tuple(presented), questions=("q",), repetitions=40)
    drawn = draw_plan(
        Design(name="try", participants=20, seed=3, stimuli=stimuli, questions=(question,), blocks=(block,))
    )
    given = answers(SimulatedParticipant(d_prime=d_prime, spread=0, lapse=0), drawn, question)
    hits, alarms = (sum(said == yes for trial, said in given if trial.stimulus == one) for one in presented)
    assert measure(hits, 800, alarms, 800).d_prime == pytest.approx(d_prime, abs=0.2 if kind == "yes-no" else 0.3)


@pytest.mark.long
def test_ratings_and_magnitudes_are_answers():
    stimuli = tuple(Stimulus(name=o, source="x", levels={"object": o}) for o in OBJECTS)
    rating = Question(name="q", kind="rating", text="?", levels={"rated": "towel"})
    drawn = plan(rating, stimuli, repetitions=10)
    given = answers(SimulatedParticipant(rating_effect=2.0), drawn, rating)
    assert all(rating.read(answer) == answer for _, answer in given)
    match = np.mean([int(answer) for trial, answer in given if trial.stimulus == "towel"])
    other = np.mean([int(answer) for trial, answer in given if trial.stimulus != "towel"])
    assert match - other == pytest.approx(2.0, abs=0.3)
    magnitude = Question(name="q", kind="magnitude", text="?")
    drawn = plan(magnitude, stimuli, repetitions=10)
    given = answers(SimulatedParticipant(magnitude=20), drawn, magnitude)
    assert np.median([float(magnitude.read(answer)) for _, answer in given]) == pytest.approx(20, rel=0.3)


def test_an_answer_is_independent_of_earlier_ones():
    question = Question(name="q", kind="choice", text="?", options=OBJECTS, truth="object")
    stimuli = tuple(Stimulus(name=o, source="x", levels={"object": o}) for o in OBJECTS)
    drawn = plan(question, stimuli, participants=2, repetitions=5)
    once = answers(SimulatedParticipant(seed=4), drawn, question)
    backwards = [SimulatedParticipant(seed=4).answer(drawn, trial, "q")[0] for trial, _ in reversed(once)]
    assert backwards[::-1] == [answer for _, answer in once]
    assert answers(SimulatedParticipant(seed=5), drawn, question) != once
