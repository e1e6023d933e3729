import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import InputError
from midair.study.design.question import Question, Stimulus, right_answer
from midair.study.design.study_design import Block, Design

CHOICE = Question(name="which", kind="choice", text="Which?", options=("brush", "towel"), truth="object")
BRUSH = Stimulus(name="s1", kind="object", source="brush", levels={"object": "brush"})
TOWEL = Stimulus(name="s2", source="towel.drive.h5", levels={"object": "towel"})


def design(**changes):
    parts = {
        "name": "tiny",
        "participants": 2,
        "seed": 1,
        "stimuli": (BRUSH, TOWEL),
        "questions": (CHOICE,),
        "blocks": (Block(name="b", stimuli=("s1", "s2"), questions=("which",)),),
    }
    return Design(**(parts | changes))


@given(low=st.integers(-5, 5), size=st.integers(1, 10), said=st.integers(-10, 20))
def test_every_step_of_a_scale_is_an_answer_and_nothing_else(low, size, said):
    question = Question(name="r", kind="rating", text="?", low=low, high=low + size)
    if low <= said <= low + size:
        assert question.read(str(said)) == str(said)
    else:
        with pytest.raises(InputError):
            question.read(str(said))


def test_right_answers():
    assert right_answer(CHOICE, BRUSH, {"object": "brush"}) == "brush"
    yes = Question(name="y", kind="yes-no", text="?")
    assert (right_answer(yes, BRUSH, {}), right_answer(yes, Stimulus(name="n", kind="silence"), {})) == ("yes", "no")
    same = Question(name="d", kind="same-different", text="?")
    assert right_answer(same, Stimulus(name="p", kind="pair", members=("s1", "s1")), {}) == "same"
    assert right_answer(same, Stimulus(name="p", kind="pair", members=("s1", "s2")), {}) == "different"
    assert right_answer(Question(name="r", kind="rating", text="?"), BRUSH, {}) == ""
