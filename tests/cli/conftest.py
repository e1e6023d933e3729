import json

import pytest

from midair.cli import run


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def own_state(tmp_path, monkeypatch):
    """Logs of playing are in `state`, beside the files of the test."""
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))


@pytest.fixture
def one_line(capsys):
    """Return the only line of an error among what was printed since the last look."""

    def read():
        (line,) = (line for line in capsys.readouterr().err.splitlines() if line.startswith("midair: "))
        return line

    return read


@pytest.fixture
def answer(capsys):
    """Run a command with --json, and return its answer."""

    def ask(*words):
        capsys.readouterr()
        assert run([*words, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return ask
