import json
import signal
import subprocess
import sys
import threading
import time
from collections import Counter

import numpy as np
import pytest

from midair.errors import BrokenFileError, DeviceStateError, InputError, LinkLostError, MismatchError, SilentFramesError
from midair.model import Medium
from midair.study.design.answers import answers_table
from midair.study.design.plan import draw_plan
from midair.study.design.session_state import replay
from midair.study.folder import StudyFolder, read_design, template_text
from midair.study.session.event_log import EventLog, read_events
from midair.study.session.participant import SimulatedParticipant, SimulatedScreen
from midair.study.session.presenters import ExperimenterPresenter, SilentPresenter
from midair.study.session.trials import AGAIN, Reply, Session, run


@pytest.fixture(scope="module")
def plan():
    return draw_plan(read_design(template_text("paper"), participants=2))


class Recorder:
    def __init__(self):
        self.done = []
        self.silenced = 0

    def present(self, stimulus):
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


def to_the_first_stimulus(one):
    while one.step.kind != "present":
        one.acknowledge() if one.step.kind == "show" else one.answer(Reply(text="left"))


def interrupted(plan, path, after):
    screen = Script(plan, stop_after=after)
    with pytest.raises(RuntimeError, match="power cut"), session(plan, path) as one:
        run(one, screen)
    return screen


def test_a_whole_session(plan, tmp_path):
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
    assert "rest 60" in screen.seen


@pytest.mark.parametrize(
    ("room", "stored"),
    [(None, None), (Medium.at(temperature=23.5, humidity=0.4), {"temperature_c": 23.5, "humidity": 0.4})],
    ids=["not stated", "stated"],
)
def test_the_air_of_the_room_is_in_the_log(plan, tmp_path, room, stored):
    with session(plan, tmp_path / "log.jsonl", room=room):
        pass
    assert read_events(tmp_path / "log.jsonl")[0]["room"] == stored


def test_no_step_reveals_the_condition(plan, tmp_path):
    screen = Script(plan)
    with session(plan, tmp_path / "log.jsonl") as one:
        run(one, screen)
    hidden = {trial.stimulus for trial in plan.trials} | {"plain", "grooved", "reproduced"}
    said = "\n".join(screen.seen) + (tmp_path / "log.jsonl").read_text()
    assert not [word for word in hidden if word in said]


def test_a_wrong_answer_is_asked_again_and_not_stored(plan, tmp_path):
    with session(plan, tmp_path / "log.jsonl") as one:
        to_the_first_stimulus(one)
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

    def present(self, stimulus):
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


def test_repeated_failures_end_a_session_that_can_be_resumed(plan, tmp_path):
    with pytest.raises(SilentFramesError, match=r"trial 3: the array failed 3 times.*frames 5 to 9"):  # noqa: SIM117
        with session(plan, tmp_path / "log.jsonl", Faulty(silent=(2, 3, 4))) as one:
            run(one, Script(plan))
    presenter = Recorder()
    with session(plan, tmp_path / "log.jsonl", presenter) as one:
        run(one, Script(plan))
    assert presenter.done[0] == plan.of(1)[2].stimulus


def test_an_array_that_is_lost_ends_the_session_and_the_trial_is_marked(plan, tmp_path):
    with pytest.raises(LinkLostError):  # noqa: SIM117
        with session(plan, tmp_path / "log.jsonl", Faulty(silent=(1,), error=LinkLostError)) as one:
            run(one, Script(plan))
    assert [event["trial"] for event in read_events(tmp_path / "log.jsonl") if event["event"] == "silent"] == [
        plan.of(1)[1].code
    ]


def test_resume_asks_only_what_has_no_answer(plan, tmp_path):
    first = interrupted(plan, tmp_path / "log.jsonl", after=14)  # within the first trial with four questions
    presenter, second = Recorder(), Script(plan)
    with session(plan, tmp_path / "log.jsonl", presenter) as one:
        run(one, second)
    assert first.asked + second.asked == [(trial.code, name) for trial in plan.of(1) for name in trial.questions]
    assert presenter.done[0] == plan.of(1)[12].stimulus  # the unfinished trial is presented again
    assert replay(read_events(tmp_path / "log.jsonl"), plan, 1).interruptions == 1


@pytest.mark.parametrize(("policy", "again"), [("restart", 0), ("block", 15)])
def test_policies_discard_answers_but_keep_them_in_the_log(plan, tmp_path, policy, again):
    interrupted(plan, tmp_path / "log.jsonl", after=12 + 3 * 4 + 6)
    screen = Script(plan)
    with session(plan, tmp_path / "log.jsonl", policy=policy) as one:
        run(one, screen)
    assert screen.asked[0][0] == plan.of(1)[again].code
    events = read_events(tmp_path / "log.jsonl")
    progress = replay(events, plan, 1)
    assert progress.next_trial == len(plan.of(1))
    assert progress.withdrawn == (12 + 3 * 4 + 6 if policy == "restart" else 6)
    assert sum(event["event"] == "answer" for event in events) == len(progress.answers) + progress.withdrawn
    assert [event["policy"] for event in events if event["event"] == "resume"] == [policy]


def test_an_interrupted_session_gives_the_same_answers(plan, tmp_path):
    interrupted(plan, tmp_path / "a.jsonl", after=21)
    for name in ("a", "b"):
        with session(plan, tmp_path / f"{name}.jsonl") as one:
            run(one, Script(plan))
    a, b = (replay(read_events(tmp_path / f"{name}.jsonl"), plan, 1).answers for name in "ab")
    assert {key: one.answer for key, one in a.items()} == {key: one.answer for key, one in b.items()}


def test_a_finished_session_asks_nothing_again(plan, tmp_path):
    for _ in range(2):
        screen = Script(plan)
        with session(plan, tmp_path / "log.jsonl", policy="restart") as one:
            assert run(one, screen).kind == "done"
    assert screen.asked == []


def test_stop_silences_first_and_ends_the_session(plan, tmp_path):
    class Slow(Recorder):
        def __init__(self):
            super().__init__()
            self.quiet = threading.Event()
            self.began = threading.Event()

        def present(self, stimulus):
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


def test_an_error_of_the_presenter_silences_it(plan, tmp_path):
    class Broken(Recorder):
        def present(self, stimulus):
            raise OSError("link lost")

    presenter = Broken()
    with pytest.raises(OSError, match="link lost"), session(plan, tmp_path / "log.jsonl", presenter) as one:
        run(one, Script(plan))
    assert presenter.silenced >= 1
    assert read_events(tmp_path / "log.jsonl")[-1]["reason"] == "OSError"


def test_the_experimenter_sees_the_object_to_present(plan, tmp_path):
    told = []
    presenter = ExperimenterPresenter(tell=told.append, done=lambda: None)
    with session(plan, tmp_path / "log.jsonl", presenter) as one:
        run(one, Script(plan))
    assert told[0] == f"present: {plan.design.stimulus(plan.of(1)[0].stimulus).source}"
    assert told[-1].startswith("remove the object: nothing may touch")


def test_another_plan_or_another_program_is_refused(plan, tmp_path):
    interrupted(plan, tmp_path / "log.jsonl", after=3)
    other = draw_plan(read_design(template_text("paper"), seed=9))
    with pytest.raises(MismatchError, match="changed"), session(other, tmp_path / "log.jsonl"):
        pass
    pytest.importorskip("fcntl")
    with (
        session(plan, tmp_path / "log.jsonl"),
        pytest.raises(DeviceStateError, match="another program"),
        session(plan, tmp_path / "log.jsonl"),
    ):
        pass


def test_calls_in_the_wrong_order(plan, tmp_path):
    one = session(plan, tmp_path / "log.jsonl")
    with pytest.raises(DeviceStateError, match="context manager"):
        one.present()
    with one, pytest.raises(DeviceStateError, match="expected the step ask, got show"):
        one.answer(Reply(text="brush"))
    with pytest.raises(DeviceStateError, match="open log"):
        EventLog(tmp_path / "x").append({"event": "x"})


def test_a_torn_line_is_removed_and_logged(tmp_path):
    path = tmp_path / "log.jsonl"
    with EventLog(path) as log:
        log.append({"event": "one"})
    path.write_bytes(path.read_bytes() + b'{"event": "answ')
    assert [event["event"] for event in read_events(path)] == ["one"]
    with EventLog(path) as log:
        log.append({"event": "two"})
    assert [event["event"] for event in read_events(path)] == ["one", "repair", "two"]
    path.write_bytes(b'not json\n{"event": "x"}\n')
    with pytest.raises(BrokenFileError, match="line 1"):
        read_events(path)


CHILD = """
import os, sys, json
from pathlib import Path
from midair.study.session.presenters import SilentPresenter
from midair.study.session.participant import SimulatedScreen
from midair.study.folder import StudyFolder
from midair.study.session.trials import Session, run
from midair.study.session.participant import SimulatedParticipant

folder, witness = StudyFolder(Path(sys.argv[1])), os.open(sys.argv[2], os.O_WRONLY | os.O_CREAT | os.O_APPEND)
plan = folder.plan()

class Screen(SimulatedScreen):
    def ask(self, step):
        os.write(witness, json.dumps(["asked", step.code, step.question.name]).encode() + b"\\n")
        return super().ask(step)
    def accepted(self, step, answer):
        os.write(witness, json.dumps(["accepted", step.code, step.question.name, answer]).encode() + b"\\n")

print("ready", flush=True)
number = int(sys.argv[3])
with Session(plan, number, folder.log(number), SilentPresenter(), simulated=True) as session:
    print("open", flush=True)
    run(session, Screen(plan=plan, participant=SimulatedParticipant(seed=1)))
"""


def killed_run(folder, witness, number, wait, sign):
    """Run a session in a new process and kill it `wait` s after its first output; return whether it had finished."""
    process = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(folder), str(witness), str(number)], stdout=subprocess.PIPE, text=True
    )
    with process:
        while process.stdout.readline() != f"{sign}\n":
            assert process.poll() is None
        time.sleep(wait)
        process.send_signal(signal.SIGKILL)
        process.communicate()
    return process.returncode == 0


def witnessed(path, what):
    """Complete output lines of the process for each question."""
    lines = path.read_bytes().split(b"\n")[:-1] if path.exists() else []
    return [tuple(rest) for said, *rest in map(json.loads, lines) if said == what]


@pytest.mark.parametrize("kills", [pytest.param(2, marks=pytest.mark.long), pytest.param(200, marks=pytest.mark.slow)])
def test_no_kill_loses_an_answer_or_asks_twice(tmp_path, kills):
    text = template_text("paper").replace("repetitions = 4", "repetitions = 40")
    # Some sessions end before their kill, about one in ten: enough people to outlast the kills.
    design = read_design(text, participants=max(15, kills // 4), name="kill")
    study = StudyFolder.create(tmp_path / "study", text, design)
    plan, witness, rng = study.plan(), tmp_path / "witness", np.random.default_rng(kills)
    number, killed = 1, 0
    while killed < kills:
        sign = rng.choice(["ready", "open", "open"])
        finished = killed_run(study.path, witness, number, float(rng.uniform(0, 0.1)), sign)
        killed += not finished
        stored = {key: one.answer for progress in study.sessions() for key, one in progress.answers.items()}
        # Questions without a code belong to the form, which has its own events.
        accepted = {(code, name): answer for code, name, answer in witnessed(witness, "accepted") if code}
        assert accepted.items() <= stored.items(), f"kill {killed}: an answer was lost"
        assert len(stored) - len(accepted) <= killed  # stored, but killed before the confirmation
        number += finished
    events = [event for n in range(1, number + 1) for event in read_events(study.log(n))]
    answers = Counter((event["trial"], event["question"]) for event in events if event["event"] == "answer")
    assert max(answers.values()) == 1, "a question that had its answer was asked again"
    asked = Counter(one for one in witnessed(witness, "asked") if one[0])
    again = sum(count - 1 for count in asked.values())
    assert again <= killed  # only what was asked when the process died is asked again
    resumed = sum(event["event"] == "resume" for event in events)
    assert resumed > kills / 4  # the kills did hit running sessions
    assert set(answers) <= {(trial.code, name) for trial in plan.trials for name in trial.questions}
