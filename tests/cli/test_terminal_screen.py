import os
import sys
import termios
import threading
import time

import pytest
from rich.console import Console

from midair.cli.terminal_screen import TerminalScreen
from midair.study import Question, TrialStep

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such terminals")
CHOICE = Question(name="w", kind="choice", text="Which?", options=("brush", "sponge"))


@pytest.fixture
def terminal():
    master, slave = os.openpty()
    yield master, slave
    os.close(master)
    os.close(slave)


def asked(terminal, question, *typed, width=100):
    """Ask at the terminal while keys are typed after their times in s; return the reply and the printed text."""
    master, slave = terminal

    def type_all():
        # Earlier keys are discarded, so wait for the prompt.
        while question.keys and "Press " not in console.export_text(clear=False):
            time.sleep(0.005)
        for after, keys in typed:
            time.sleep(after)
            os.write(master, keys)

    with open(os.devnull, "w") as nowhere, open(slave, closefd=False) as keys:
        console = Console(file=nowhere, record=True, width=width)
        typing = threading.Thread(target=type_all)
        typing.start()
        reply = TerminalScreen(console, keys).ask(
            TrialStep(kind="ask", code="p01-t001", number=1, total=2, question=question)
        )
        typing.join()
        return reply, console.export_text()


def test_a_single_key_answers_with_its_reaction_time_and_the_terminal_is_restored(terminal):
    before = termios.tcgetattr(terminal[1])
    os.write(terminal[0], b"1")  # before the question: discarded
    begin = time.monotonic()
    reply, shown = asked(terminal, CHOICE, (0.5, b"x"), (0.3, b"2"))
    assert (reply.text, reply.by, reply.late) == ("sponge", "key", False)
    assert 0.3 < reply.reaction_s < time.monotonic() - begin
    assert "1  brush" in shown
    assert "Press 1, 2" in shown
    assert termios.tcgetattr(terminal[1]) == before


@pytest.mark.long
def test_no_key_within_the_time_limit_is_late(terminal):
    reply, _ = asked(terminal, Question(name="w", kind="yes-no", text="?", timeout_s=0.1))
    assert (reply.late, reply.text, reply.reaction_s) == (True, "", 0.1)


def test_lines_have_a_time_limit(terminal, monkeypatch):
    number = Question(name="m", kind="magnitude", text="How strong?", timeout_s=0.5)
    with os.fdopen(os.dup(terminal[1])) as lines:
        monkeypatch.setattr("sys.stdin", lines)
        for typed, said, late in ((b"12\n", "12", False), (b"12", "", True)):
            reply, shown = asked(terminal, number, (0.1, typed))
            assert (reply.text, reply.late, reply.by) == (said, late, "line")
            assert "any number of 0 or more" in shown


def test_options_that_are_numbers_are_not_numbered(terminal):
    count = Question(name="n", kind="choice", text="How many?", options=("2", "3", "4"))
    reply, shown = asked(terminal, count, (0.2, b"2"))
    assert reply.text == "2"
    assert "1  2" not in shown
