"""Text of strangers on the terminal does nothing but be read; -q and -v are read wherever they stand."""

import json
import sys
from contextlib import contextmanager

import pytest
from rich.progress import Task
from rich.table import Table

from midair.cli import app, run
from midair.cli.comparisons import palm_lines
from midair.cli.console import (
    PerSecond,
    PlainConsole,
    elapsed_time,
    err,
    out,
    parse_flags,
    print_answer,
    print_grid,
    print_rows,
    progress_bars,
    verbosity,
)
from midair.cli.output import print_table
from midair.errors import InputError
from midair.evaluate import PalmFidelity
from midair.files import FormatLoss
from midair.table import Details, Row, printed

HOSTILE = "a[/]b[red]c:smile:\x1b]0;title\x07\x1b[2J\u202ed"
SHOWN = "a[/]b[red]c:smile:\\x1b]0;title\\x07\\x1b[2J\\u202ed"


def test_text_is_neither_markup_nor_an_escape_sequence(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    prints = [
        lambda: out().print(HOSTILE),
        lambda: err().print(HOSTILE, style="bold red"),
        lambda: print_rows([(HOSTILE, "value")]),
        lambda: print_rows([("name", HOSTILE)]),
        lambda: print_answer(HOSTILE, simulated=True),
        lambda: print_grid(("", "a"), [("b", "1")], title=HOSTILE),
        lambda: print_grid(("", HOSTILE), [("b", "1")]),
        lambda: print_grid(("", "a"), [("b", HOSTILE)]),
    ]
    for number, each in enumerate(prints):
        each()
        said = "".join(capsys.readouterr())
        assert (SHOWN in said, "\x1b" in said) == (True, False), number


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
    task = Task(1, "solve", 5200, 0, _get_time=lambda: 380.0)  # other bars are open for longer
    task.start_time, task.completed, task.finished_time, task.finished_speed = 0.0, 5200, 38.0, 1301722.0
    assert PerSecond("frames").render(task).plain.split() == ["137", "frames/s"]


def test_verbosity_flags_are_removed_at_any_position():
    how, rest = parse_flags(["-q", "solve", "-v", "a b.h5"])
    assert (how.quiet, how.verbose, how.line, rest) == (True, True, "midair solve 'a b.h5'", ["solve", "a b.h5"])
    assert parse_flags(["solve", "--verbose"])[0].verbose
    how, rest = parse_flags(["info", "--", "-q"])
    assert (how.quiet, rest) == (False, ["info", "--", "-q"])


def test_quiet_shows_results_and_no_bars_and_verbose_the_run_time(capsys):
    def works() -> None:
        with progress_bars() as stage:
            stage("work")(1, 1)
        print("done", verbosity().quiet)

    app.command(works, name="works")
    assert run(["works"]) == 0
    assert "work " in capsys.readouterr().err
    assert run(["works", "-q"]) == 0
    assert capsys.readouterr() == ("done True\n", "")
    assert run(["works", "-v"]) == 0
    assert "took 0." in capsys.readouterr().err
    del app["works"]


def test_elapsed_time_appears_late_and_ends_with_the_first_output(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    with elapsed_time("soon", after=60):
        pass
    assert capsys.readouterr() == ("", "")
    said = ""
    with elapsed_time("compare", after=0):
        while "compare" not in said:
            said += capsys.readouterr().err
        out().print("result")
        capsys.readouterr()
        with progress_bars() as stage:
            stage("solve")(1, 1)
        assert "compare" not in capsys.readouterr().err
    monkeypatch.delenv("FORCE_COLOR")
    with elapsed_time("info", after=0):
        pass
    assert capsys.readouterr() == ("", "")


def test_palm_fidelity_is_printed_for_each_skin():
    skins = {"soft": 15.04, "stiff": 20.0}
    found = palm_lines(PalmFidelity(outside=0.0312, pressure=12.34, square=17.0, displacement=skins, palm="mine"))
    assert printed(found) == [("beside", "3.1 % of the power outside the recorded square")]
    aside = PalmFidelity(outside=0.9999, pressure=1.0, square=1.0, displacement=skins, palm="aside")
    assert printed(palm_lines(aside)) == [("beside", "100 % of the power outside the recorded square")]
    rows = dict(printed(found, all=True))
    assert rows["palm"].startswith("mine; ")
    assert rows["palm, pressure"] == "12.3 dB over the palm, 17.0 dB within the square"
    assert rows["palm, movement"] == "15.0 dB (soft), 20.0 dB (stiff)"


def test_commands_that_run_until_stopped_show_no_elapsed_time(monkeypatch):
    timed = []

    @contextmanager
    def noted(words):
        timed.append(words)
        yield

    monkeypatch.setattr(sys.modules["midair.cli.app"], "elapsed_time", noted)
    for line in ("studio", "serve adaptics", "live", "record", "study run x", "study plan x", "cut"):
        run([*line.split(), "--help"])
    assert timed == ["study", "cut"]


def test_bars_without_a_stage_leave_no_line(capsys):
    with pytest.raises(InputError), progress_bars():
        raise InputError("refused")
    with progress_bars() as stage:
        stage("play")(1, 1)
    printed = capsys.readouterr()
    assert (printed.out, printed.err.count("\n"), printed.err[:4]) == ("", 1, "play")


def test_a_table_is_printed_or_json(capsys):
    table = [
        Row("rate", 1000.0, key="rate_hz", text="1000 Hz"),
        Row("frames", 3, text="3 of 4"),
        Row("note", None, text=""),
        ("source", "towel"),
        ("age", ""),
        {"kind": "take"},
        Details([Row("more", 7), Details([("most", "all")])]),
    ]
    made = []

    def later():
        made.append(1)
        return Details([Row("later", 8)])

    table.append(later)
    assert printed(table) == [("rate", "1000 Hz"), ("frames", "3 of 4"), ("source", "towel")]
    assert not made
    assert printed(table, all=True)[3:] == [("more", "7"), ("most", "all"), ("later", "8")]
    print_table(table, json=True)
    values = {"rate_hz": 1000.0, "frames": 3, "note": None, "kind": "take", "more": 7, "later": 8, "simulated": False}
    assert json.loads(capsys.readouterr().out) == values
    how = {"notes": ["cut"], "lost": [FormatLoss(what="rate", text="No rate.")]}
    print_table(table, json=True, simulated=True, **how)
    more = {"simulated": True, "notes": ["cut"], "lost": [{"what": "rate", "text": "No rate."}]}
    assert json.loads(capsys.readouterr().out) == values | more
    print_table(table, json=False, answer="a towel", simulated=True, **how)
    said = capsys.readouterr().out
    assert said.startswith("SIMULATED  a towel\nrate ")
    assert all(word in said for word in ("frames", "note    cut", "lost    No rate."))
    print_table(table, json=False, simulated=False)
    assert "SIMULATED" not in "".join(capsys.readouterr())
