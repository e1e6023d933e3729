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

from midair.study.folder import StudyFolder

ROOT = Path(__file__).parents[4]
PROMPTS = {
    **dict.fromkeys(("Press Enter to continue", "Enter to continue", "Press Enter after the presentation"), ("Enter",)),
    **{"Press 1, 2, 3, 4, 5, 6, 7": ("5",), "Press 1, 2, 3": ("2",), ">": ("AB12", "Enter")},
}
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

    def type(self, *keys):
        subprocess.run([*self._tmux, "send-keys", *keys], check=True)

    def shown(self):
        page = subprocess.run([*self._tmux, "capture-pane", "-p", "-J"], capture_output=True, text=True, check=True)
        return page.stdout

    def run(self, command, limit):
        """Type a command and answer until it is over; gives its status and how often each prompt was answered."""
        self._commands += 1
        told = f"status{self._commands}="
        self.type(f"clear; {command}; echo {told}$?", "Enter")
        answered, before, until = Counter(), "", time.monotonic() + limit
        while not (over := re.search(rf"^{told}(\d+)", self.shown(), re.MULTILINE)):
            assert time.monotonic() < until, self.shown()
            page = self.shown()
            last = next((line for line in reversed(page.splitlines()) if line.strip()), "")
            # A line that begins with > and goes on is an answer that was given.
            asked = [text for text in PROMPTS if last.strip() == text or (text != ">" and last.startswith(text))]
            if asked and page != before:
                answered[asked[0]] += 1
                # An answer within 0.2 s cannot be a considered one: the plan excludes it.
                time.sleep(0.3 * asked[0].startswith("Press"))
                self.type(*PROMPTS[asked[0]])
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
    subprocess.run([*made._tmux, "kill-server"], check=False)


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_a_session_of_the_paper_by_keys_from_plan_to_report(terminal, tmp_path):
    page = (ROOT / "docs" / "study.md").read_text(encoding="utf-8").partition("one session on a virtual array")[2]
    block = page.partition("```console\n")[2].partition("```")[0]
    commands = [line.removeprefix("$ ").split("#")[0].strip() for line in block.splitlines()]
    assert [shlex.split(line)[2] for line in commands] == ["new", "run", "analyse"]
    for line in commands:
        status, answered = terminal.run(line, limit=500)
        assert status == 0, terminal.shown()
        if " run " in line:
            # 42 trials, each with a choice; 30 of them with three ratings; the hand; 12 objects by the experimenter.
            assert answered["Press 1, 2, 3"] == 42 + 1
            assert (answered["Press 1, 2, 3, 4, 5, 6, 7"], answered[">"]) == (90, 1)
    (session,) = StudyFolder(tmp_path / "touch").sessions()
    assert (len(session.answers), {given.by for given in session.answers.values()}) == (132, {"key"})
    assert session.form == {"pseudonym": "AB12", "hand": "right"}
    assert session.simulated, "the array was"
    played = [json.loads(line) for line in (tmp_path / "state" / "played.jsonl").read_text().splitlines()]
    assert sum(entry["event"] == "play" for entry in played) == 30
    assert "SIMULATED" in (tmp_path / "touch" / "report.html").read_text(encoding="utf-8")
