import pytest

from midair.errors import BrokenFileError
from midair.study.design.plan import draw_plan
from midair.study.design.session_state import answers_table, replay
from midair.study.folder import read_design, template_text

PLAN = draw_plan(read_design(template_text("paper"), participants=1))
TRIAL = PLAN.of(1)[0]
OPEN = {"event": "open", "plan": PLAN.digest, "participant": 1, "simulated": True}
ANSWER = {
    **{"event": "answer", "trial": TRIAL.code, "question": TRIAL.questions[0]},
    **{"answer": "brush", "reaction_s": 0.5, "time": "2026-11-22T00:00:00+00:00"},
}


def test_a_valid_log_gives_a_table_of_answers():
    assert answers_table(PLAN, [replay([OPEN, ANSWER], PLAN, 1)])["answer"].tolist() == ["brush"]


@pytest.mark.parametrize(
    ("event", "why"),
    [
        *(
            ({key: value for key, value in ANSWER.items() if key != gone}, f"'{gone}' is missing")
            for gone in list(ANSWER)[1:]
        ),
        ({**ANSWER, "trial": ["a"]}, r"trial is \"\['a'\]\""),
        ({**ANSWER, "answer": None}, "answer is 'None'"),
        ({**ANSWER, "reaction_s": "n/a"}, "reaction_s is 'n/a'"),
        ({**ANSWER, "reaction_s": True}, "reaction_s is 'True'"),
        ({"event": "resume"}, "'redo' is missing"),
        ({"event": "resume", "redo": 3}, "not iterable"),
        ({"event": "resume", "redo": [{}]}, "unhashable"),
        ({"event": "present", "trial": {}, "stimulus": "x"}, "trial is '{}'"),
        ({"event": "open", "plan": PLAN.digest}, "'participant' is missing"),
    ],
)
def test_a_damaged_event_gives_one_error_line(event, why):
    with pytest.raises(BrokenFileError, match=why) as told:
        replay([OPEN, event], PLAN, 1)
    assert str(told.value).startswith("log: expected the events of participant 1, got a damaged event")
