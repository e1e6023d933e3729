import json
import shutil
from pathlib import Path

import pydantic
import pytest

from midair.cli import run


@pytest.fixture(scope="session", autouse=True)
def _adapters_once():
    """Make the adapters of types once, which takes most of a parse."""
    adapter, adapters = pydantic.TypeAdapter, {}

    class Once(adapter):
        __class_getitem__ = adapter.__class_getitem__

        def __new__(cls, hint, **how):
            if how:
                return adapter(hint, **how)
            if id(hint) not in adapters:
                adapters[id(hint)] = adapter(hint), hint
            return adapters[id(hint)][0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pydantic, "TypeAdapter", Once)
        yield


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def module_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("module")


@pytest.fixture
def with_take(module_folder, take_file, monkeypatch):
    """In a folder of the module, with a virtual towel in take.h5."""
    monkeypatch.chdir(module_folder)
    if not Path("take.h5").exists():
        shutil.copy(take_file, "take.h5")


@pytest.fixture
def take(take_file):
    """A virtual towel in take.h5 of the test's own folder."""
    shutil.copy(take_file, "take.h5")
    return "take.h5"


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
