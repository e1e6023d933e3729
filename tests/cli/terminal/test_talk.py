"""-q and -v are read wherever they stand, and do what the help says."""

import pytest

from midair.cli import app, run
from midair.cli.terminal import Talk, flags_of, stages, talk


def test_flags_are_taken_out_wherever_they_stand():
    assert flags_of(["-q", "solve", "-v", "a.h5"]) == (Talk(quiet=True, verbose=True), ["solve", "a.h5"])
    assert flags_of(["solve", "--verbose"]) == (Talk(verbose=True), ["solve"])
    assert flags_of(["info", "--", "-q"]) == (Talk(), ["info", "--", "-q"])


@pytest.fixture
def working():
    def works() -> None:
        with stages() as stage:
            stage("work")(1, 1)
        print("done", talk().quiet)

    app.command(works, name="works")
    yield
    del app["works"]


def test_quiet_shows_results_and_no_bars(working, capsys):
    assert run(["works"]) == 0
    assert "work " in capsys.readouterr().err
    assert run(["works", "-q"]) == 0
    assert capsys.readouterr() == ("done True\n", "")


def test_verbose_says_what_it_took(working, capsys):
    assert run(["works", "-v"]) == 0
    assert "took 0." in capsys.readouterr().err


def test_it_holds_for_one_command_only(working, capsys):
    run(["works", "-q"])
    assert talk() == Talk()
