"""A whole session of the paper's experiment at a terminal, typed key by key: as docs/study.md prints it."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from tests.study.every_kind import QUESTIONS, plan_text

from midair.study.design.session_state import right_answer_of_trial
from midair.study.folder import StudyFolder

ROOT = Path(__file__).parents[4]
PROMPTS = [
    ("Press Enter to continue", ["Enter"]),
    ("Enter to continue", ["Enter"]),
    ("Press Enter after the presentation", ["Enter"]),
    ("Press 1, 2, 3, 4, 5, 6, 7", ["5"]),
    ("Press 1, 2, 3", ["2"]),
    (">", ["AB12", "Enter"]),
]
"""Last line of the terminal, and the keys to type."""


class Terminal:
    """A pseudo-terminal with scripted keys."""

    def __init__(self, folder):
        self._commands = 0
        self._tmux = ["tmux", "-S", str(folder / "tmux")]  # A server of its own: another one may still be ending
        shell = {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "MIDAIR_STATE": str(folder / "state")}
        subprocess.run(
            [*self._tmux, "-f", "/dev/null", "new-session", "-d", "-x", "100", "-y", "50", "-c", str(folder), "bash"],
            env=os.environ | shell,
            check=True,
        )

    def close(self):
        subprocess.run([*self._tmux, "kill-server"], check=False)

    def type(self, *keys):
        subprocess.run([*self._tmux, "send-keys", *keys], check=True)

    def shown(self):
        page = subprocess.run([*self._tmux, "capture-pane", "-p", "-J"], capture_output=True, text=True, check=True)
        return page.stdout

    def run(self, command, limit, prompts=PROMPTS):
        """Type a command and answer until it is over; gives its status and how often each prompt was answered.

        Of a prompt without keys, the text of the page is asked for them.
        """
        self._commands += 1
        told = f"status{self._commands}="
        self.type(f"clear; {command}; echo {told}$?", "Enter")
        answered, before, until = Counter(), "", time.monotonic() + limit
        while not (over := re.search(rf"^{told}(\d+)", self.shown(), re.MULTILINE)):
            assert time.monotonic() < until, self.shown()
            page = self.shown()
            last = next((line for line in reversed(page.splitlines()) if line.strip()), "")
            # A line that begins with > and goes on is an answer that was given.
            asked = [
                (text, keys)
                for text, keys in prompts
                if last.strip() == text or (text != ">" and last.startswith(text))
            ]
            keys = next(iter(asked), None)
            if keys and page != before:
                answered[keys[0]] += 1
                # An answer within 0.2 s cannot be a considered one: the plan excludes it.
                time.sleep(0.3 * keys[0].startswith("Press"))
                self.type(*(keys[1](page) if callable(keys[1]) else keys[1]))
                before = page
                if "Please rest" in page:
                    time.sleep(1)
            time.sleep(0.03)
        return int(over[1]), answered


@pytest.fixture
def terminal(tmp_path):
    if shutil.which("tmux") is None:
        pytest.skip("tmux is not there: apt-get install tmux")
    made = Terminal(tmp_path)
    yield made
    made.close()


def printed(after="one session on a virtual array"):
    """The commands of a walk through a session that the page on studies prints after some words."""
    page = (ROOT / "docs" / "study.md").read_text(encoding="utf-8")
    block = page.partition(after)[2].partition("```console\n")[2].partition("```")[0]
    return [line.removeprefix("$ ").split("#")[0].strip() for line in block.splitlines()]


class Observer:
    """A simulated participant who feels strong stimuli; answers from the plan and the log."""

    def __init__(self, folder, least):
        self._folder, self._least = StudyFolder(folder), least

    def __call__(self, page):
        """The key for the question at the end of a page."""
        plan, session = self._folder.plan(), self._folder.sessions()[0]
        trial = plan.of(1)[int(re.findall(r"(\d+) of \d+ ", page)[-1]) - 1]
        name = trial.questions[0]
        stimulus = plan.design.stimulus(trial.stimulus or session.chosen[trial.code])
        faint = float(stimulus.levels.get("percent", self._least)) < self._least
        options = plan.design.question(name).keys
        right = "no" if faint and "no" in options.values() else right_answer_of_trial(plan, trial, session.chosen, name)
        # Without a difference the answer is the first.
        right = next(iter(options.values())) if faint and right != "no" else right
        return [next((key for key, answer in options.items() if answer == right), next(iter(options)))]


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_a_session_of_the_paper_by_keys_from_plan_to_report(terminal, tmp_path):
    commands = printed()
    assert [shlex.split(line)[2] for line in commands] == ["new", "run", "analyse"]
    for line in commands:
        status, answered = terminal.run(line, limit=500)
        assert status == 0, terminal.shown()
        if " run " in line:
            # 42 trials, each with a choice; 30 of them with three ratings; the hand; 12 objects by the experimenter.
            assert answered["Press 1, 2, 3"] == 42 + 1
            assert answered["Press 1, 2, 3, 4, 5, 6, 7"] == 90
            assert answered[">"] == 1
    (session,) = StudyFolder(tmp_path / "touch").sessions()
    assert len(session.answers) == 132
    assert {given.by for given in session.answers.values()} == {"key"}
    assert session.form == {"pseudonym": "AB12", "hand": "right"}
    assert session.simulated, "the array was"
    played = [json.loads(line) for line in (tmp_path / "state" / "played.jsonl").read_text().splitlines()]
    assert sum(entry["event"] == "play" for entry in played) == 30
    assert "SIMULATED" in (tmp_path / "touch" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.timeout(1500)
@pytest.mark.parametrize(
    ("template", "least", "questions"),
    [
        ("detection", 10.0, ["felt"]),
        ("paired", 0.0, ["closer", "how_close", "words"]),
    ],
)
def test_a_session_of_every_other_template_by_keys_from_plan_to_report(terminal, tmp_path, template, least, questions):
    commands = [line.replace("detection", template) for line in printed("There are three more templates")]
    assert [shlex.split(line)[2] for line in commands] == ["new", "run", "analyse"]
    prompts = [
        ("Press Enter to continue", ["Enter"]),
        ("Enter to continue", ["Enter"]),
        ("Press 1, 2, 3", ["2"]),
        ("Press 1, 2", Observer(tmp_path / "weak", least)),
        ("Arrow keys", ["Up", "Right", "Right", "Enter"]),
        (">", ["AB12", "Enter"]),
    ]
    for line in commands:
        status, answered = terminal.run(line, limit=900, prompts=prompts)
        assert status == 0, terminal.shown()
        if " run " in line:
            assert answered["Press 1, 2, 3"] == 1
    folder = StudyFolder(tmp_path / "weak")
    (session,) = folder.sessions()
    assert session.next_trial == len(session.trials)
    assert {name for _, name in session.answers} == set(questions)
    assert {given.by for (_, name), given in session.answers.items() if name != "words"} == {"key"}
    page = (tmp_path / "weak" / "report.html").read_text(encoding="utf-8")
    assert "SIMULATED" in page
    assert "Not computed" not in page
    if template == "paired":
        assert {given.answer for (_, name), given in session.answers.items() if name == "how_close"} == {"62"}
        assert "24 answers are correct" in page
        return
    assert not session.untrained, "whoever feels what is strong has learned it"
    found = float(re.search(r"Median of 1 thresholds: ([\d.]+)", page)[1])
    assert least / 2 < found < least * 2


@pytest.mark.slow
def test_a_study_of_every_kind_of_stimulus_and_question_by_keys(terminal, tmp_path):
    """Touch, silence, an object, a text and pairs; seven kinds of answers. Pictures and sounds need the studio."""
    (tmp_path / "kinds.toml").write_text(plan_text(media=False))
    prompts = [
        ("Press Enter to continue", ["Enter"]),
        ("Enter to continue", ["Enter"]),
        ("Press Enter after the presentation", ["Enter"]),
        ("Press 1, 2, 3, 4, 5, 6, 7", ["5"]),
        ("Press 1, 2", ["1"]),
        ("Arrow keys", ["Up", "Right", "Enter"]),
        (">", ["3", "Enter"]),
    ]
    for line in (
        "midair record virtual:towel weak.h5 --duration 0.2s",
        "midair study new kinds --source kinds.toml --mode quick",
        "midair study run kinds --participant 1 --array virtual --noise none",
        "midair study analyse kinds --draws 50",
    ):
        status, answered = terminal.run(line, limit=120, prompts=prompts)
        assert status == 0, terminal.shown()
        if " run " in line:
            # 4 single stimuli; a pair in both orders, and a mixed one; magnitudes and the form are lines.
            assert (answered["Arrow keys"], answered[">"]) == (4, 5)
            assert answered["Press 1, 2"] == 4 + 2 + 1
    (session,) = StudyFolder(tmp_path / "kinds").sessions()
    given = {name for _, name in session.answers}
    assert given | set(session.form) == set(QUESTIONS)
    assert {one.answer for (_, name), one in session.answers.items() if name == "slider"} == {"61"}
    assert session.next_trial == len(session.trials) == 7
