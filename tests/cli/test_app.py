"""Whatever goes wrong, a person sees one line and a program sees the exit status."""

import os
import re
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

FAILURES = [
    (KeyError("rate"), "KeyError: 'rate'"),
    (RuntimeError(), "RuntimeError"),
    (ValueError("one\n[/] two\x1b[2J"), "one [/] two\\x1b[2J"),
    (RecursionError("maximum recursion depth exceeded"), "RecursionError"),
    (MemoryError(), "not enough memory"),
    (OSError(30, "Read-only file system", "/data/a.h5"), "/data/a.h5: Read-only file system"),
]


def test_an_unexpected_error_is_one_line_and_its_traceback_can_be_had(capsys, monkeypatch):
    def fails() -> None:
        raise raised[-1]

    raised = []
    app.command(fails, name="fails")
    try:
        for wrong, words in FAILURES:
            raised.append(wrong)
            assert run(["fails"]) == 1, words
            said = capsys.readouterr()
            assert (said.out, said.err[:8], said.err.count("\n")) == ("", "midair: ", 1), words
            assert words in said.err
            assert "\x1b" not in said.err, words
        # A long message is cut between its file and its advice.
        raised.append(InputError(f"a.h5: expected a unit, got {'x' * 60_000!r}; give one with --unit"))
        assert run(["fails"]) == 1
        assert re.fullmatch(
            r"midair: a\.h5: expected a unit, got 'x.{,2000}x'; give one with --unit\n", capsys.readouterr().err
        )
        raised.append(KeyError("rate"))
        monkeypatch.setenv("MIDAIR_TRACEBACK", "1")
        with pytest.raises(KeyError):
            run(["fails"])
    finally:
        del app["fails"]


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


@pytest.mark.long
def test_a_name_that_is_no_text_or_that_the_terminal_cannot_spell_is_printed(tmp_path):
    save(Recording(samples=np.zeros((30, 4, 4)), rate=1000.0), tmp_path / "tüß☃.h5")
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
    gone, there = (
        subprocess.run([sys.executable, "-m", "midair", "info", name], capture_output=True, check=False, env=env)
        for name, env in ((os.fsencode(tmp_path) + b"/\xff.h5", None), (tmp_path / "tüß☃.h5", ascii_only))
    )
    assert (gone.returncode, gone.stderr[:8], b"Traceback" in gone.stderr) == (1, b"midair: ", False)
    assert rb"\udcff.h5" in gone.stderr
    assert there.returncode == 0
    assert rb"\u2603" in there.stdout
