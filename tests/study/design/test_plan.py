from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import BrokenFileError, InputError
from midair.study.design.plan import balanced_latin_square, block_order, constrained_shuffle, draw_plan, longest_run_of
from midair.study.design.session_state import answers_table, replay
from midair.study.folder import read_design, template_text


@pytest.fixture(scope="module")
def plan():
    return draw_plan(read_design(template_text("paper")))


def test_the_papers_numbers(plan):
    # Section 5.3: 12 trials with real objects; each stimulus once; three kinds four times; two surfaces; 10 people.
    assert plan.design.participants == 10
    for number in range(1, 11):
        trials = plan.of(number)
        assert len(trials) == 12 + 2 * (3 + 12)
        counts = Counter((trial.block, trial.stimulus) for trial in trials)
        assert {counts[key] for key in counts if key[0] in ("real", "plain_scored", "grooved_scored")} == {4}
        assert {counts[key] for key in counts if key[0].endswith("first")} == {1}
        assert [trial.scored for trial in trials].count(False) == 6
        for block in ("real", "plain_scored", "grooved_scored"):
            assert longest_run_of([trial.stimulus for trial in trials if trial.block == block]) <= 3
    reproduced = [trial for trial in plan.of(1) if trial.block == "plain_scored"]
    assert {len(trial.questions) for trial in reproduced} == {4}


def test_surfaces_are_counterbalanced_and_real_objects_come_first(plan):
    first = Counter()
    for number in range(1, 11):
        groups = list(dict.fromkeys(block.group for block in block_order(plan.design, number)))
        assert groups[0] == "real"
        first[groups[1]] += 1
    assert first == {"plain": 5, "grooved": 5}


def test_sessions_are_counterbalanced_too():
    text = template_text("paper").replace('group = "grooved"', 'group = "grooved"\nsession = 2')
    days = draw_plan(read_design(text, participants=4))
    first = Counter()
    for number in range(1, 5):
        trials = days.of(number)
        assert [trial.session for trial in trials] == sorted(trial.session for trial in trials)
        assert {trial.session for trial in trials if trial.group == "real"} == {1}
        (surface,) = {trial.group for trial in trials if trial.session == 1} - {"real"}
        (other,) = {trial.group for trial in trials if trial.session == 2}
        assert {surface, other} == {"plain", "grooved"}
        first[surface] += 1
    assert first == {"plain": 2, "grooved": 2}


def test_a_group_with_blocks_in_two_sessions_keeps_them():
    text = template_text("paper").replace('name = "grooved_scored"', 'name = "grooved_scored"\nsession = 2', 1)
    days = draw_plan(read_design(text.replace('name = "plain_scored"', 'name = "plain_scored"\nsession = 2', 1)))
    for number in (1, 2):
        blocks = [(block.name, block.session) for block in block_order(days.design, number)][1:]
        assert sorted(blocks) == [("grooved_first", 1), ("grooved_scored", 2), ("plain_first", 1), ("plain_scored", 2)]
        assert [name.split("_")[0] for name, _ in blocks] == (
            ["plain", "grooved"] if number == 1 else ["grooved", "plain"]
        ) * 2


def test_the_seed_decides_more_people_change_nothing_and_codes_reveal_nothing(plan):
    assert draw_plan(plan.design) == plan
    assert draw_plan(replace(plan.design, seed=1)).trials != plan.trials
    more = draw_plan(replace(plan.design, participants=12))
    assert more.of(7) == plan.of(7)
    assert more.digest != plan.digest
    codes = [trial.code for trial in plan.trials]
    assert len(set(codes)) == len(codes)
    words = {word for trial in plan.trials for word in (trial.stimulus, trial.block, *trial.levels.values())}
    assert not any(word in code for code in codes for word in words)


WHEN = "2026-01-01T10:00:00+00:00"


def opened(plan):
    return {"event": "open", "plan": plan.digest, "participant": 1, "simulated": False, "time": WHEN}


def answered(trial, question, answer="brush"):
    told = {"event": "answer", "trial": trial.code, "question": question, "answer": answer}
    return told | {"reaction_s": 1.0, "time": WHEN}


def test_replay_continues_at_the_first_unanswered_trial(plan):
    trials = plan.of(1)
    events = [opened(plan)] + [answered(trial, "closest") for trial in trials[:13]]
    progress = replay(events, plan, 1)
    assert progress.next_trial == 12  # the first trial with four questions has one answer
    assert set(progress.open_questions(trials[12])) == {"like_brush", "like_sponge", "like_towel"}
    later = replay([*events, {"event": "resume"}], plan, 1)
    assert (later.next_trial, len(later.answers)) == (12, 13)


def test_answers_table_contains_the_conditions(plan):
    trial = plan.of(1)[0]
    right = trial.levels["object"]
    wrong = "towel" if right != "towel" else "brush"
    second = plan.of(1)[1]
    events = [opened(plan), answered(trial, "closest", right), answered(second, "closest", wrong)]
    table = answers_table(plan, [replay(events, plan, 1)])
    row = table.iloc[0]
    assert (row["right"], row["answer"], row["correct"]) == (right, right, 1)
    assert (row["object"], row["presentation"], row["surface"], row["rated"]) == (right, "real", "n/a", "n/a")
    assert row["participant"] == "sub-01"
    assert table["correct"][1] == int(second.levels["object"] == wrong)


def test_square_is_balanced():
    assert balanced_latin_square(4) == [[0, 1, 3, 2], [1, 2, 0, 3], [2, 3, 1, 0], [3, 0, 2, 1]]
    for count in range(1, 11):
        square = balanced_latin_square(count)
        assert len(square) == (2 * count if count % 2 and count > 1 else count)
        for place in range(count):
            assert set(Counter(row[place] for row in square).values()) == {len(square) // count}
        after = Counter(pair for row in square for pair in pairwise(row))
        assert len(after) == count * (count - 1)
        assert len(set(after.values())) <= 1


@given(
    counts=st.lists(st.integers(1, 6), min_size=1, max_size=4),
    longest=st.integers(1, 3),
    seed=st.integers(0, 100),
)
def test_shuffle_keeps_items_and_limit_or_raises(counts, longest, seed):
    items = [i for i, count in enumerate(counts) for _ in range(count)]
    possible = max(counts) <= longest * (sum(counts) - max(counts) + 1)
    rng = np.random.default_rng(seed)
    if not possible:
        with pytest.raises(InputError, match="allow longer runs"):
            constrained_shuffle(items, rng=rng, longest_run=longest)
        return
    order = constrained_shuffle(items, rng=rng, longest_run=longest)
    assert sorted(order) == items
    assert longest_run_of(order) <= longest


def test_allowed_orders_are_equally_likely():
    rng = np.random.default_rng(0)
    assert sorted(constrained_shuffle("aaa", rng=rng)) == list("aaa")
    seen = Counter(tuple(constrained_shuffle("aabbc", rng=rng, longest_run=1)) for _ in range(6000))
    assert len(seen) == 12  # orders of aabbc without equal neighbours
    assert max(seen.values()) < 1.25 * 6000 / 12
    assert min(seen.values()) > 0.75 * 6000 / 12


PLAN = draw_plan(read_design(template_text("paper"), participants=1))
TRIAL = PLAN.of(1)[0]
ANSWER = answered(TRIAL, TRIAL.questions[0])


def test_a_damaged_event_gives_one_error_line(subtests):
    begun = {name: value for name, value in opened(PLAN).items() if name != "time"}
    for event, why in [
        *(
            ({key: value for key, value in ANSWER.items() if key != gone}, f"'{gone}' is missing")
            for gone in list(ANSWER)[1:]
        ),
        ({**ANSWER, "trial": ["a"]}, r"trial is \"\['a'\]\""),
        ({**ANSWER, "answer": None}, "answer is 'None'"),
        ({**ANSWER, "reaction_s": "n/a"}, "reaction_s is 'n/a'"),
        ({**ANSWER, "reaction_s": True}, "reaction_s is 'True'"),
        ({"event": "present", "trial": {}, "stimulus": "x"}, "trial is '{}'"),
        ({"event": "open", "plan": PLAN.digest}, "'participant' is missing"),
    ]:
        with subtests.test(why=why), pytest.raises(BrokenFileError, match=why) as told:
            replay([begun, event], PLAN, 1)
        assert str(told.value).startswith("log: expected the events of participant 1, got a damaged event")
