"""The stand-in itself: what the makers say of Grbl 1.1, asked byte by byte."""

import os
import re
import time
from contextlib import contextmanager

import pytest
from tests.simulators.grbl import GrblSimulator


class Line:
    """Bytes to a stand-in and lines from it, with no driver between."""

    def __init__(self, machine):
        self.machine = machine
        self.file = os.open(machine.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.heard = ""

    def say(self, data):
        os.write(self.file, data)

    def until(self, words, seconds=20):
        end = time.monotonic() + seconds
        while not (found := re.search(words, self.heard)):
            assert time.monotonic() < end, f"{words!r} was not heard in {self.heard!r}"
            try:
                self.heard += os.read(self.file, 4096).decode()
            except BlockingIOError:
                time.sleep(0.002)
        self.heard = self.heard[found.end() :]
        return found

    def report(self):
        self.say(b"?")
        return self.until(r"<(\S+?)\|MPos:(\S+?),(\S+?),(\S+?)\|FS:(\d+),0\S*>")


@contextmanager
def line(**options):
    machine = GrblSimulator(**options)
    talk = Line(machine)
    try:
        yield talk
    finally:
        os.close(talk.file)
        machine.close()


def test_it_greets_and_is_locked_until_it_was_homed():
    with line(homed=False) as talk:
        talk.until(r"Grbl 1\.1h \['\$' for help\]\r\n\[MSG:'\$H'\|'\$X' to unlock\]")
        assert talk.report()[1] == "Alarm"
        talk.say(b"G0X-10\n")
        talk.until("error:9")
        talk.say(b"$H\n")
        talk.until("ok")
        assert talk.report().groups()[:4] == ("Idle", "-1.000", "-1.000", "-1.000")


@pytest.mark.long
def test_a_line_takes_the_time_of_a_trapezoid():
    with line() as talk:
        talk.say(b"G21G90G94G53G1X-121Y-1Z-1F3000\nG4P0.01\n")
        talk.until("ok")
        talk.until("ok")
        move = talk.machine.moves[0]
    # 120 mm at 50 mm/s, speeding up and slowing down at 500 mm/s2: 120/50 + 50/500 s.
    assert move.duration == pytest.approx(2.5)
    assert [move.at(move.begun + t)[0][0] for t in (0.0, 0.1, 1.25, 2.5)] == pytest.approx([-1, -3.5, -61, -121])
    assert move.at(move.begun + 1.0)[1] == pytest.approx(50)


def test_bytes_beyond_the_buffer_are_lost():
    with line() as talk:
        talk.say(b"G4P3\n")
        time.sleep(0.1)
        talk.say(b"(" + b"x" * 200 + b"\n")
        time.sleep(0.2)
        assert talk.machine.lost == 202 - 127


def test_a_hold_slows_down_and_a_reset_at_rest_keeps_the_place():
    with line() as talk:
        talk.until("Grbl")
        talk.say(b"G21G90G53G1X-200Y-1Z-1F6000\n")
        talk.until("ok")
        time.sleep(0.5)
        talk.say(b"!")
        assert talk.report()[1] in ("Hold:1", "Hold:0")
        while (report := talk.report())[1] != "Hold:0":
            pass
        talk.say(b"\x18")
        talk.until("Grbl 1.1h")
        after = talk.report()
        assert (after[1], after[2]) == ("Idle", report[2])
        assert -199 < float(after[2]) < -1


def test_a_reset_while_it_moves_and_a_limit_switch_are_alarms():
    with line() as talk:
        talk.until("Grbl")
        talk.say(b"G21G90G53G1X-200Y-1Z-1F6000\n")
        talk.until("ok")
        time.sleep(0.2)
        talk.say(b"\x18")
        talk.until("ALARM:3")
        talk.say(b"$X\n")
        talk.until("ok")
        talk.machine.switch = (0, -100.0)
        talk.say(b"G53G1X-150F6000\n")
        talk.until(r"ALARM:1\r\n\[MSG:Reset to continue\]\r\n")
        assert abs(talk.machine.place[0] + 100) < 10
        talk.say(b"?")
        time.sleep(0.2)
        with pytest.raises(BlockingIOError):  # nothing is said until it is reset
            os.read(talk.file, 1)


@pytest.mark.parametrize(
    ("words", "answer"),
    [(b"G1X-5\n", "error:22"), (b"G7\n", "error:20"), (b"$Q\n", "error:3"), (b"hello!\n", "error:1"), (b"\n", "ok")],
)
def test_lines_it_cannot_use_are_refused_by_number(words, answer):
    with line() as talk:
        talk.until("Grbl")
        talk.say(words.replace(b"!", b""))
        talk.until(answer)


def test_soft_limits_are_an_alarm_that_keeps_the_place():
    with line(settings={20: 1}) as talk:
        talk.say(b"G53G0X5\n")
        talk.until("ALARM:2")
