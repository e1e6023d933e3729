from dataclasses import replace

from midair.study.design.plan import draw_plan
from midair.study.design.question import Question, Stimulus
from midair.study.design.session_state import answers_table, excluded_participants, replay
from midair.study.design.study_design import Block, Criterion, Design, Exclusions, Extra
from midair.study.session.event_log import read_events
from midair.study.session.presenters import SilentPresenter
from midair.study.session.trials import InstantClock, Reply, Session

WHICH = Question(name="which", kind="choice", text="Which?", options=("a", "b"), truth="object")
NAME = Question(name="pseudonym", kind="text", text="Pseudonym?", private=True)
HAND = Question(name="hand", kind="choice", text="Hand?", options=("left", "right"))
STIMULI = tuple(Stimulus(name=f"s_{o}", kind="object", source=o, levels={"object": o}) for o in "ab")


class Slow(InstantClock):
    """A clock that records waiting times and returns a time that tests set."""

    def __init__(self):
        self.waited, self.time = [], 0.0

    def wait(self, seconds, ended):
        self.waited.append(seconds)

    def elapsed(self):
        return self.time


def plan_of(*blocks, questions=(WHICH,), stimuli=STIMULI, **changes):
    return draw_plan(
        Design(name="t", participants=1, seed=3, stimuli=stimuli, questions=questions, blocks=blocks, **changes)
    )


def block(**changes):
    return Block(**({"name": "b", "stimuli": ("s_a", "s_b"), "questions": ("which",), "repetitions": 4} | changes))


def go(plan, log, answer=lambda trial, question: trial.levels["object"], clock=None, steps=10**9):
    seen, trials = [], {trial.code: trial for trial in plan.trials}
    with Session(plan, 1, log, SilentPresenter(), clock=clock or InstantClock()) as one:
        while one.step.kind != "done" and len(seen) < steps:
            step = one.step
            seen.append(step)
            if step.kind == "present":
                one.present()
            elif step.kind == "ask":
                said = answer(trials.get(step.code), step.question)
                one.answer(said if isinstance(said, Reply) else Reply(text=said))
            else:
                one.acknowledge()
    return seen


def kinds(seen):
    return [step.kind for step in seen]


def standing(plan, log):
    return replay(read_events(log), plan, 1)


def test_the_form_is_asked_once_and_a_private_answer_stays_in_the_log(tmp_path):
    plan = plan_of(block(), questions=(WHICH, NAME, HAND), form=("pseudonym", "hand"))

    def answer(trial, question):
        return {"pseudonym": "Ada07", "hand": "right"}.get(question.name) or trial.levels["object"]

    go(plan, tmp_path / "log", answer, steps=5)
    seen = go(plan, tmp_path / "log", answer)
    assert "hand" not in [step.question.name for step in seen if step.question]
    found = standing(plan, tmp_path / "log")
    assert found.form == {"pseudonym": "Ada07", "hand": "right"}
    table = answers_table(plan, [found])
    assert set(table["hand"]) == {"right"}
    assert "pseudonym" not in table
    assert "Ada07" not in table.to_csv()


def test_training_ends_with_its_criterion(tmp_path):
    training = block(name="train", criterion=Criterion(right=1.0, last=4), feedback=True, scored=False, repetitions=10)
    plan = plan_of(training, block())
    for wrong_until, trials in ((0, 4), (3, 7)):

        def answer(trial, _question, until=wrong_until):
            wrong = trial.block == "train" and trial.number <= until
            return {"a": "b", "b": "a"}[trial.levels["object"]] if wrong else trial.levels["object"]

        seen = go(plan, log := tmp_path / f"{trials}", answer)
        assert len([step for step in seen if step.kind == "present" and step.number <= 20]) == trials
        told = [step.text for step in seen if step.kind == "show"]
        assert len([text for text in told if text.startswith("Wrong. The correct answer is ")]) == wrong_until
        assert told.count("Correct.") == trials - wrong_until
        found = standing(plan, log)
        assert (len(found.waived), found.untrained, found.next_trial) == (20 - trials, (), 28)
        assert len(answers_table(plan, [found])) == trials + 8


def test_participants_without_the_criterion_are_excluded_if_planned(tmp_path):
    training = block(name="train", criterion=Criterion(right=1.0, last=4), scored=False)
    plan = plan_of(training, block(), exclusions=Exclusions(training=True))
    go(plan, tmp_path / "log", lambda *_: "a")
    found = standing(plan, tmp_path / "log")
    assert found.untrained == ("train",)
    (row,) = excluded_participants(plan, [found]).to_dict("records")
    assert (row["participant"], row["rule"]) == ("sub-01", "training")
    assert not answers_table(plan, [found])["scored"].any()


def test_breaks_within_a_block_and_the_time_before_a_stimulus_is_drawn_and_kept(tmp_path):
    plan, clock = plan_of(block(break_every=3, rest_s=5.0, jitter_s=(0.5, 1.5))), Slow()
    seen = kinds(go(plan, tmp_path / "log", clock=clock))
    assert [seen[:at].count("present") for at, kind in enumerate(seen) if kind == "rest"] == [3, 6]
    assert clock.waited == [trial.wait_s for trial in plan.trials]
    assert len(set(clock.waited)) == 8
    assert 0.5 <= min(clock.waited) < max(clock.waited) <= 1.5


def test_each_stimulus_and_each_member_of_a_pair_has_a_cue(tmp_path):
    pair = Stimulus(name="p", kind="pair", members=("s_a", "s_b"), levels={"object": "a"}, gap_s=0.7)
    plan, told, clock = plan_of(block(stimuli=("p",), repetitions=1), stimuli=(*STIMULI, pair)), [], Slow()
    with Session(plan, 1, tmp_path / "log", SilentPresenter(), clock=clock) as one:
        assert one.step.text == "Feel now."
        one.present(told.append)
    assert (told, clock.waited) == (["Feel now. First.", "Feel now. Second.", ""], [0.0, 0.7])


def test_answers_after_the_time_limit_do_not_count(tmp_path):
    plan = plan_of(
        block(repetitions=1), questions=(replace(WHICH, timeout_s=2.0),), exclusions=Exclusions(timeouts=0.4)
    )
    clock = Slow()
    with Session(plan, 1, tmp_path / "log", SilentPresenter(), clock=clock) as one:
        one.present()
        clock.time = 2.5
        assert one.answer(Reply(text="a")) == "n/a"
        one.present()
        assert one.answer(Reply(text="a", reaction_s=1.9, by="key")) == "a"
    found = standing(plan, tmp_path / "log")
    table = answers_table(plan, [found])
    assert table["answer"].tolist() == ["n/a", "a"]
    assert (table["excluded"].tolist(), table["correct"].tolist()[0]) == (["timeout", "participant: timeouts"], -1)
    assert table["reaction_by"].tolist() == ["n/a", "key"]
    late = next(event for event in read_events(tmp_path / "log") if event["event"] == "late")
    assert late["said"] == "a", "what was said too late stays in the log"


def test_answers_too_fast_or_too_slow_are_left_out_one_by_one(tmp_path):
    plan = plan_of(block(repetitions=2), exclusions=Exclusions(fastest_s=0.2, slowest_s=10))
    times = iter([0.1, 0.3, 9.0, 11.0])
    go(plan, tmp_path / "log", lambda trial, _: Reply(text=trial.levels["object"], reaction_s=next(times), by="key"))
    table = answers_table(plan, [standing(plan, tmp_path / "log")])
    assert table["excluded"].tolist() == ["too fast", "n/a", "n/a", "too slow"]
    assert table["scored"].tolist() == [False, True, True, False]


def test_extras_are_never_first_and_attention_is_checked(tmp_path):
    press = Question(name="press", kind="choice", text="Press b.", options=("a", "b"), truth="key")
    pause = Stimulus(name="pause", kind="silence", levels={"key": "b"})
    anchor = Stimulus(name="anchor", kind="object", source="iron", levels={"object": "a"})
    extras = (
        Extra(role="attention", stimuli=("pause",), questions=("press",), repetitions=2),
        Extra(role="anchor", stimuli=("anchor",), repetitions=3),
    )
    plan = plan_of(
        block(extras=extras),
        questions=(WHICH, press),
        stimuli=(*STIMULI, pause, anchor),
        exclusions=Exclusions(attention=0.6),
    )
    roles = [trial.role for trial in plan.trials]
    assert (len(roles), roles.count("attention"), roles.count("anchor"), roles[0]) == (13, 2, 3, "test")
    pressed = iter(["b", "a"])
    go(plan, tmp_path / "log", lambda trial, q: next(pressed) if q.name == "press" else trial.levels["object"])
    found = standing(plan, tmp_path / "log")
    (row,) = excluded_participants(plan, [found]).to_dict("records")
    assert (row["rule"], row["value"], row["limit"]) == ("attention", 0.5, 0.6)
    assert set(answers_table(plan, [found])["excluded"]) == {"participant: attention"}
    lenient = replace(plan, design=replace(plan.design, exclusions=Exclusions(attention=0.5)), digest=plan.digest)
    table = answers_table(lenient, [found])
    assert table.loc[table["scored"], "role"].unique().tolist() == ["test"]


def test_several_sessions_follow_each_other(tmp_path):
    plan = plan_of(block(name="b2", session=2), block(name="b1", session=1), consent="Welcome.")
    assert [trial.session for trial in plan.trials] == [1] * 8 + [2] * 8
    log = tmp_path / "log"
    assert kinds(go(plan, log)).count("present") == 8
    assert standing(plan, log).next_trial == 8
    second = go(plan, log)
    assert (kinds(second).count("present"), second[0].text) == (8, "Welcome.")
    found = standing(plan, log)
    assert found.next_trial == 16
    assert sorted(found.began) == [1, 2]
    assert kinds(go(plan, log)) == []
    table = answers_table(plan, [found])
    assert table["session"].tolist() == [1] * 8 + [2] * 8


def test_options_and_questions_are_shuffled_by_the_seed_and_logged(tmp_path):
    options = ("brush", "sponge", "towel")
    asked = (
        Question(name="which", kind="choice", text="?", options=options, truth="object", shuffle=True),
        Question(name="how", kind="rating", text="?"),
    )
    things = tuple(Stimulus(name=n, kind="object", source=n, levels={"object": n}) for n in options)
    one = Block(name="b", stimuli=options, questions=("which", "how"), repetitions=8, shuffle_questions=True)
    design = Design(name="s", participants=1, seed=3, stimuli=things, questions=asked, blocks=(one,))
    plan = draw_plan(design)
    assert plan == draw_plan(design)
    assert {trial.questions for trial in plan.trials} == {("which", "how"), ("how", "which")}
    orders = []
    with Session(plan, 1, tmp_path / "log", SilentPresenter(), clock=InstantClock()) as session:
        while session.step.kind != "done":
            if session.step.kind == "present":
                session.present()
                continue
            if session.step.question.name == "which":
                orders.append(session.step.question.options)
            session.answer(Reply(text="2"))
        session.stop("the studio was ended")
    assert len(set(orders)) > 3
    assert standing(plan, tmp_path / "log").stops == []
    logged = [event for event in read_events(tmp_path / "log") if event.get("question") == "which"]
    assert [tuple(event["options"]) for event in logged] == orders
    assert [event["answer"] for event in logged] == [order[1] for order in orders]
    assert orders[0] == asked[0].in_order_of(plan.trials[0].code, seed=3).options
