import io
import time

from rich.console import Console

from midair.cli.waiting import BusyBar, waiting
from midair.progress import report_progress


def screen(*, terminal):
    return Console(file=io.StringIO(), force_terminal=terminal, width=60)


def until(true, *, within=5.0):
    ends = time.monotonic() + within
    while not true() and time.monotonic() < ends:
        time.sleep(0.005)
    return true()


def test_appears_when_it_takes_long_and_goes_with_the_end():
    console = screen(terminal=True)
    line = BusyBar("compare", console, after=0.01)
    assert until(lambda: line.visible)
    line.end()
    line.end()
    assert not line.visible
    assert "compare" in console.file.getvalue()


def test_short_work_shows_nothing():
    console = screen(terminal=True)
    with waiting("info", console) as line:
        assert not line.visible
    assert console.file.getvalue() == ""


def test_nothing_is_shown_without_a_terminal():
    console = screen(terminal=False)
    line = BusyBar("info", console, after=0.0)
    time.sleep(0.05)
    assert not line.visible
    line.end()
    assert console.file.getvalue().strip() == ""


def test_time_left_is_of_all_passes_and_the_end_moves_on_where_there_are_more():
    line = BusyBar("cut", screen(terminal=False), passes=4)
    assert line.share is None
    shares = []
    for done in (5, 10, 10, 10, 10, 10):
        line.report(done, 10)
        shares.append(line.share)
    assert shares == [1 / 8, 1 / 4, 2 / 4, 3 / 4, 1, 1]


def test_progress_inside_the_block_is_shown():
    with waiting("cut", screen(terminal=False), passes=2) as line:
        assert list(report_progress("abcd", 4)) == list("abcd")
        assert line.share == 0.5
