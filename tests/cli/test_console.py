"""Text of strangers on the terminal does nothing but be read; -q and -v are read wherever they stand."""

import pytest
from rich.table import Table

from midair.cli import app, run
from midair.cli.console import (
    PlainConsole,
    Verbosity,
    err,
    out,
    parse_flags,
    print_figures,
    print_rows,
    progress_bars,
    verbosity,
)

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
