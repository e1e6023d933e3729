"""Whatever goes wrong, a person sees one line and a program sees the exit status."""

import os
import signal
import subprocess
import sys
import warnings

import numpy as np
import pytest

from midair.cli import app, main, run
from midair.errors import InputError
from midair.files import save
from midair.model import Recording

FAILURES = {
    "bug": (KeyError("rate"), "KeyError: 'rate'"),
    "silent": (RuntimeError(), "RuntimeError"),
    "lines": (ValueError("one\n[/] two\x1b[2J"), "one [/] two\\x1b[2J"),
    "depth": (RecursionError("maximum recursion depth exceeded"), "RecursionError"),
    "memory": (MemoryError(), "not enough memory"),
    "disk": (OSError(30, "Read-only file system", "/data/a.h5"), "/data/a.h5: Read-only file system"),
}


@pytest.fixture(params=FAILURES)
def failure(request):
    wrong, said = FAILURES[request.param]

    def fails() -> None:
        raise wrong

    app.command(fails, name="fails")
    yield said
    del app["fails"]


def test_an_unexpected_error_is_one_line(failure, capsys):
    assert run(["fails"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("midair: ")
    assert said.err.count("\n") == 1
    assert failure in said.err
    assert "\x1b" not in said.err


def test_a_long_message_is_cut_between_its_file_and_its_advice(capsys):
    def fails() -> None:
        raise InputError(f"a.h5: expected a unit, got {'x' * 60_000!r}; give one with --unit")

    app.command(fails, name="fails")
    try:
        assert run(["fails"]) == 1
    finally:
        del app["fails"]
    said = capsys.readouterr().err
    assert len(said) < 2100
    assert said.startswith("midair: a.h5: expected a unit, got 'xxx")
    assert said.endswith("xxx'; give one with --unit\n")


def test_control_characters_in_warnings_of_libraries_are_escaped(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["midair", "--version"])
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # it ignores Ctrl-C while the process exits
    with warnings.catch_warnings():
        with pytest.raises(SystemExit):
            main()
        warnings.simplefilter("always")
        warnings.warn("Glyph 27 (\x1b[31m) is missing", UserWarning, stacklevel=1)
    said = capsys.readouterr().err
    assert "UserWarning: Glyph 27 (\\x1b[31m) is missing\n" in said
    assert "\x1b" not in said
    assert "stacklevel" not in said  # no line of the source


@pytest.mark.parametrize("failure", ["bug"], indirect=True)
def test_the_traceback_can_be_had(failure, monkeypatch):
    monkeypatch.setenv("MIDAIR_TRACEBACK", "1")
    with pytest.raises(Exception):  # noqa: B017  # any of them
        run(["fails"])


@pytest.mark.long
def test_a_file_name_that_is_no_text_is_printed(tmp_path):
    name = os.fsencode(tmp_path) + b"/\xff.h5"
    done = subprocess.run([sys.executable, "-m", "midair", "info", name], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("midair: ")
    assert "\\udcff.h5" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.long
def test_a_name_that_the_terminal_cannot_spell_is_printed_all_the_same(tmp_path):
    take = tmp_path / "tüß☃.h5"
    save(Recording(samples=np.zeros((30, 4, 4)), rate=1000.0), take)
    done = subprocess.run(
        [sys.executable, "-m", "midair", "info", str(take)],
        capture_output=True,
        check=False,
        env=os.environ | {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"},
    )
    assert done.returncode == 0
    assert rb"\u2603" in done.stdout
