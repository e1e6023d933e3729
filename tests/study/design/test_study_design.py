import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import InputError, MismatchError
from midair.study.design.question import Question, Stimulus, right_answer
from midair.study.design.study_design import Analysis, Block, Design

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
    assert right_answer(yes, BRUSH, {}) == "yes"
    assert right_answer(yes, Stimulus(name="n", kind="silence"), {}) == "no"
    same = Question(name="d", kind="same-different", text="?")
    assert right_answer(same, Stimulus(name="p", kind="pair", members=("s1", "s1")), {}) == "same"
    assert right_answer(same, Stimulus(name="p", kind="pair", members=("s1", "s2")), {}) == "different"
    assert right_answer(Question(name="r", kind="rating", text="?"), BRUSH, {}) == ""


def test_inconsistent_designs_are_refused():
    with pytest.raises(InputError, match="letters and digits"):
        design(name="my study")
    with pytest.raises(InputError, match="different names"):
        design(stimuli=(BRUSH, BRUSH))
    with pytest.raises(MismatchError, match="got 's3'"):
        design(blocks=(Block(name="b", stimuli=("s3",), questions=("which",)),))
    with pytest.raises(MismatchError, match="got 'how'"):
        design(blocks=(Block(name="b", stimuli=("s1",), questions=("how",)),))
    with pytest.raises(MismatchError, match="got 'surface'"):
        design(analysis=Analysis(choice="which", condition="surface"))
    with pytest.raises(MismatchError, match="got 'z'"):
        design(counterbalanced=("z",))
    with pytest.raises(MismatchError, match="other than columns of the answers table"):
        design(stimuli=(BRUSH, Stimulus(name="s2", kind="silence", levels={"trial": "x"})))
    with pytest.raises(InputError, match="two members"):
        Stimulus(name="p", kind="pair", members=("a",))
    with pytest.raises(InputError, match="the source"):
        Stimulus(name="p", kind="object")
