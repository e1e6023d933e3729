"""Text of strangers on the terminal does nothing but be read; -q and -v are read wherever they stand."""

import io
import time

import pytest
from rich.console import Console
from rich.progress import Task
from rich.table import Table
from tests.waiting import wait_until

from midair.cli import app, run
from midair.cli.comparisons import print_palm
from midair.cli.console import (
    BusyBar,
    PerSecond,
    PlainConsole,
    Verbosity,
    err,
    out,
    parse_flags,
    print_figures,
    print_rows,
    progress_bars,
    verbosity,
    waiting,
)
from midair.evaluate import PalmFidelity
from midair.progress import report_progress

HOSTILE = "a[/]b[red]c:smile:\x1b]0;title\x07\x1b[2J\u202ed"
SHOWN = "a[/]b[red]c:smile:\\x1b]0;title\\x07\\x1b[2J\\u202ed"


@pytest.mark.parametrize(
    "prints",
    [
        lambda: out().print(HOSTILE),
        lambda: err().print(HOSTILE, style="bold red"),
        lambda: print_rows([(HOSTILE, "value")]),
        lambda: print_rows([("name", HOSTILE)]),
        lambda: print_figures(HOSTILE, {"a": {"b": (1.0, "Pa")}}),
        lambda: print_figures("title", {HOSTILE: {"b": (1.0, "Pa")}}),
        lambda: print_figures("title", {"a": {HOSTILE: (1.0, "Pa")}}),
        lambda: print_figures("title", {"a": {"b": (1.0, HOSTILE)}}),
    ],
)
def test_text_is_neither_markup_nor_an_escape_sequence(prints, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    prints()
    said = capsys.readouterr()
    assert SHOWN in said.out + said.err
    assert "\x1b" not in said.out + said.err


def test_a_terminal_gets_our_styles_and_not_those_of_a_file(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    table = Table(HOSTILE, title=HOSTILE)
    table.add_row(HOSTILE, style="bold")
    PlainConsole().print(table)
    said = capsys.readouterr().out
    assert said.count("a[/]b[red]c:smile:") == 3
    assert "\x1b[1m" in said, "the style of the row"
    assert "\x1b]0" not in said
    assert "\x1b[2J" not in said


def test_stages_of_any_name(capsys):
    with progress_bars() as begin:
        begin(HOSTILE)(1, 2)
    assert "\x1b]0" not in capsys.readouterr().err


def test_finished_work_shows_its_mean_speed():
    task = Task(1, "solve", 5200, 0, _get_time=lambda: 38.0)
    task.start_time, task.completed, task.finished_time, task.finished_speed = 0.0, 5200, 38.0, 1301722.0
    assert PerSecond("frames", 0).render(task).plain.split() == ["137", "frames/s"]


def test_verbosity_flags_are_removed_at_any_position():
    how, rest = parse_flags(["-q", "solve", "-v", "a b.h5"])
    assert (how.quiet, how.verbose, rest) == (True, True, ["solve", "a b.h5"])
    assert how.line == "midair solve 'a b.h5'"
    assert parse_flags(["solve", "--verbose"])[0].verbose
    how, rest = parse_flags(["info", "--", "-q"])
    assert (how.quiet, rest) == (False, ["info", "--", "-q"])


@pytest.fixture
def working():
    def works() -> None:
        with progress_bars() as stage:
            stage("work")(1, 1)
        print("done", verbosity().quiet)

    app.command(works, name="works")
    yield
    del app["works"]


def test_quiet_shows_results_and_no_bars(working, capsys):
    assert run(["works"]) == 0
    assert "work " in capsys.readouterr().err
    assert run(["works", "-q"]) == 0
    assert capsys.readouterr() == ("done True\n", "")


def test_verbose_prints_the_run_time(working, capsys):
    assert run(["works", "-v"]) == 0
    assert "took 0." in capsys.readouterr().err


def test_it_holds_for_one_command_only(working, capsys):
    run(["works", "-q"])
    assert verbosity() == Verbosity()


def screen(*, terminal):
    return Console(file=io.StringIO(), force_terminal=terminal, width=60)


def test_appears_when_it_takes_long_and_goes_with_the_end():
    console = screen(terminal=True)
    line = BusyBar("compare", console, after=0.01)
    wait_until(lambda: line.visible)
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


def test_palm_fidelity_is_printed_for_each_skin(capsys):
    skins = {"soft": 15.04, "stiff": 20.0}
    print_palm(PalmFidelity(outside=0.0312, pressure=12.34, square=17.0, displacement=skins, palm="mine"))
    said = " ".join(capsys.readouterr().out.split())
    assert "fidelity on a whole palm, mine" in said
    assert "3.12 % of the power in the band" in said
    assert "pressure 12.3 dB over the palm, 17.0 dB within the square" in said
    assert "displacement 15.0 dB (soft), 20.0 dB (stiff)" in said
    assert "not measured on people" in said
