import threading
from dataclasses import replace
from hashlib import sha256

import pytest

from midair.errors import DeviceStateError, InputError, LinkLostError, MismatchError, SilentFramesError
from midair.study.design.plan import draw_plan
from midair.study.design.session_state import answers_table, replay, session_notes
from midair.study.folder import read_design, template_text
from midair.study.session.event_log import read_events
from midair.study.session.participant import SimulatedParticipant, SimulatedScreen
from midair.study.session.presenters import SilentPresenter
from midair.study.session.trials import AGAIN, GO_ON, Reply, Session, run


@pytest.fixture(scope="module")
def plan():
    return draw_plan(read_design(template_text("paper"), participants=2))


class Recorder:
    def __init__(self):
        self.done = []
        self.silenced = 0

    def present(self, stimulus, begins=bool):
        self.done.append(stimulus.name)

    def silence(self):
        self.silenced += 1


class Script:
    """A screen that raises after some answers, and records all steps."""

    def __init__(self, plan, stop_after=10**9):
        self.model = SimulatedScreen(plan=plan, participant=SimulatedParticipant(seed=1))
        self.left = stop_after
        self.asked = []
        self.seen = []

    def show(self, text):
        self.seen.append(text)

    def rest(self, step):
        self.seen.append(f"rest {step.rest_s:g}")

    def cue(self, text):
        self.seen.append(text)

    def ask(self, step):
        if not step.code:
            return self.model.ask(step)
        if not self.left:
            raise RuntimeError("power cut")
        self.left -= 1
        self.asked.append((step.code, step.question.name))
        self.seen.append(repr(step))
        return self.model.ask(step)

    def accepted(self, step, answer):
        pass

    def refused(self, step, why):
        self.seen.append(why)


def session(plan, path, presenter=None, **options):
    return Session(plan, 1, path, presenter or SilentPresenter(), **options)


def interrupted(plan, path, after):
    screen = Script(plan, stop_after=after)
    with pytest.raises(RuntimeError, match="power cut"), session(plan, path) as one:
        run(one, screen)
    return screen


def test_a_whole_session_whose_steps_do_not_reveal_the_condition(plan, tmp_path):
    presenter, screen = Recorder(), Script(plan)
    with session(plan, tmp_path / "log.jsonl", presenter) as one:
        assert run(one, screen).kind == "done"
    trials = plan.of(1)
    assert presenter.done == [trial.stimulus for trial in trials]
    assert screen.asked == [(trial.code, name) for trial in trials for name in trial.questions]
    assert presenter.silenced == 1
    events = read_events(tmp_path / "log.jsonl")
    assert [events[0]["event"], events[-1]["event"]] == ["open", "done"]
    progress = replay(events, plan, 1)
    assert progress.next_trial == len(trials)
    assert len(progress.answers) == len(screen.asked)
    assert plan.design.consent in screen.seen
    assert not any("Ctrl" in text for text in screen.seen), "the browser shows the same texts"
    assert "rest 60" in screen.seen
    hidden = {trial.stimulus for trial in plan.trials} | {"plain", "grooved", "reproduced"}
    said = "\n".join(screen.seen) + (tmp_path / "log.jsonl").read_text()
    assert not [word for word in hidden if word in said]


def test_an_answer_is_stored_before_it_is_confirmed(plan, tmp_path):
    class Witness(Script):
        def accepted(self, step, answer):
            stored = replay(read_events(tmp_path / "log.jsonl"), plan, 1).answers
            assert not step.code or stored[step.code, step.question.name].answer == answer

    interrupted_by = Witness(plan, stop_after=14)
    with pytest.raises(RuntimeError, match="power cut"), session(plan, tmp_path / "log.jsonl") as one:
        run(one, interrupted_by)
    assert len(interrupted_by.asked) == 14


def test_a_wrong_answer_is_asked_again_and_not_stored(plan, tmp_path):
    with session(plan, tmp_path / "log.jsonl") as one:
        while one.step.kind != "present":
            one.acknowledge() if one.step.kind == "show" else one.answer(Reply(text="left"))
        one.present()
        with pytest.raises(InputError, match="expected one of brush"):
            one.answer(Reply(text="cat"))
        assert one.step.kind == "ask"
        assert one.answer(Reply(text="1")) == "brush"
    answers = [event for event in read_events(tmp_path / "log.jsonl") if event["event"] == "answer"]
    assert [event["answer"] for event in answers] == ["brush"]
    assert answers[0]["reaction_s"] >= 0


class Faulty(Recorder):
    """A presenter whose array goes silent in some presentations, counted from 0."""

    def __init__(self, silent, error=SilentFramesError):
        super().__init__()
        self.silent, self.error = silent, error

    def present(self, stimulus, begins=bool):
        super().present(stimulus)
        if len(self.done) - 1 in self.silent:
            raise self.error("array: frames 5 to 9 were silent")


def test_a_failed_presentation_is_logged_and_repeated_before_the_question(plan, tmp_path):
    presenter, screen = Faulty(silent=(2, 3, 7)), Script(plan)
    with session(plan, tmp_path / "log.jsonl", presenter) as one:
        assert run(one, screen).kind == "done"
    names = [trial.stimulus for trial in plan.of(1)]
    assert presenter.done == [*names[:3], names[2], names[2], *names[3:6], names[5], *names[6:]]
    assert screen.asked == [(trial.code, name) for trial in plan.of(1) for name in trial.questions]
    assert screen.seen.count(AGAIN) == 3
    events = read_events(tmp_path / "log.jsonl")
    silent = [event for event in events if event["event"] == "silent"]
    assert [event["trial"] for event in silent] == [plan.of(1)[at].code for at in (2, 2, 5)]
    assert silent[0]["reason"] == "array: frames 5 to 9 were silent"
    table = answers_table(plan, [replay(events, plan, 1)])
    failed = table.groupby("trial")["failed_plays"].first()
    assert {trial: count for trial, count in failed.items() if count} == {3: 2, 6: 1}
    # A complete presentation comes between a silent one and the next answer.
    for at, event in enumerate(events):
        if event["event"] == "silent":
            assert [later["event"] for later in events[at + 1 :]][:2] in (
                ["present", "presented"],
                ["present", "silent"],
            )
    assert replay(events, plan, 1).next_trial == len(names)


@pytest.mark.long
def test_repeated_failures_end_a_session_that_can_be_resumed(plan, tmp_path):
    with pytest.raises(SilentFramesError, match=r"trial 3: the array failed 3 times.*frames 5 to 9"):  # noqa: SIM117
        with session(plan, tmp_path / "log.jsonl", Faulty(silent=(2, 3, 4))) as one:
            run(one, Script(plan))
    presenter = Recorder()
    with session(plan, tmp_path / "log.jsonl", presenter) as one:
        run(one, Script(plan))
    assert presenter.done[0] == plan.of(1)[2].stimulus


def test_a_lost_array_or_another_error_ends_the_session_in_silence_and_the_trial_is_marked(plan, tmp_path):
    for error in (LinkLostError, OSError):
        presenter, log = Faulty(silent=(1,), error=error), tmp_path / f"{error.__name__}.jsonl"
        with pytest.raises(error), session(plan, log, presenter) as one:
            run(one, Script(plan))
        events = read_events(log)
        marked = [plan.of(1)[1].code] if error is LinkLostError else []
        assert [event["trial"] for event in events if event["event"] == "silent"] == marked
        assert presenter.silenced >= 1
        assert events[-1]["reason"] == error.__name__


def test_resume_asks_only_what_has_no_answer(plan, tmp_path):
    first = interrupted(plan, tmp_path / "log.jsonl", after=14)  # within the first trial with four questions
    presenter, second = Recorder(), Script(plan)
    with session(plan, tmp_path / "log.jsonl", presenter) as one:
        run(one, second)
    assert first.asked + second.asked == [(trial.code, name) for trial in plan.of(1) for name in trial.questions]
    assert presenter.done[0] == plan.of(1)[12].stimulus  # the unfinished trial is presented again
    assert [event["event"] for event in read_events(tmp_path / "log.jsonl")].count("resume") == 1


def test_stop_silences_first_and_ends_the_session(plan, tmp_path):
    class Slow(Recorder):
        def __init__(self):
            super().__init__()
            self.quiet = threading.Event()
            self.began = threading.Event()

        def present(self, stimulus, begins=bool):
            self.began.set()
            assert self.quiet.wait(10)

        def silence(self):
            super().silence()
            self.quiet.set()

    presenter, screen = Slow(), Script(plan)
    with session(plan, tmp_path / "log.jsonl", presenter) as one:
        threading.Thread(target=lambda: presenter.began.wait(10) and one.stop("emergency")).start()
        assert run(one, screen).kind == "stopped"
        with pytest.raises(DeviceStateError, match="got stopped"):
            one.present()
    assert screen.asked == []
    events = read_events(tmp_path / "log.jsonl")
    assert {"event": "stop", "reason": "emergency"}.items() <= events[-1].items()
    with session(plan, tmp_path / "log.jsonl") as one:  # and it can be taken up again
        assert run(one, Script(plan)).kind == "done"


def test_another_plan_another_program_and_calls_in_the_wrong_order_are_refused(plan, tmp_path):
    interrupted(plan, tmp_path / "log.jsonl", after=3)
    other = draw_plan(read_design(template_text("paper"), seed=9))
    with pytest.raises(MismatchError, match="changed"), session(other, tmp_path / "log.jsonl"):
        pass
    again = session(plan, tmp_path / "log.jsonl")
    with session(plan, tmp_path / "log.jsonl"), pytest.raises(DeviceStateError, match="another program"), again:
        pass
    # So are calls in the wrong order.
    with pytest.raises(DeviceStateError, match="context manager"):
        again.present()
    with again, pytest.raises(DeviceStateError, match="expected the step ask, got show"):
        again.answer(Reply(text="brush"))


def test_consent_and_stops_are_logged_and_a_stopped_person_agrees_to_go_on(tmp_path):
    plan = draw_plan(read_design(template_text("paper"), participants=3))
    words = sha256(plan.design.consent.encode()).hexdigest()
    for number, reason in ((1, "the participant"), (2, "")):
        log = tmp_path / f"log{number}"
        with Session(plan, number, log, SilentPresenter()) as one:
            assert one.step.consent == "take part"
            one.acknowledge()
            one.stop(reason or "left by the experimenter")
    consent = [event for event in read_events(tmp_path / "log1") if event["event"] == "consent"]
    assert [(event["to"], event["sha256"]) for event in consent] == [("take part", words)]
    with Session(plan, 1, tmp_path / "log1", SilentPresenter()) as one:
        assert (one.step.text, one.step.consent) == (GO_ON, "go on")
        one.acknowledge()
        assert one.step.consent == "take part"
        assert not one.standing().stopped
        one.stop("the participant")
    with Session(plan, 1, tmp_path / "log1", SilentPresenter()) as one:
        one.acknowledge()
        before = [replay(read_events(tmp_path / f"log{n}"), plan, n) for n in (1, 2)]
    assert session_notes(plan, [*before, replace(before[0], stops=(), answers={})])[1:] == (
        f"2 of 2 people agreed to the text of the plan (SHA-256 {words[:16]}).",
        "The sessions of 2 of 2 people were stopped: sub-01 (the participant, the participant; agreed to go on), "
        "sub-02 (left by the experimenter).",
        "Sessions that are not finished: sub-01 (0 of 42 trials), sub-02 (0 of 42 trials).",
    )
