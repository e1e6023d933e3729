import json
import shutil
from pathlib import Path

import cyclopts
import pydantic
import pytest

from midair.cli import run


@pytest.fixture(scope="session", autouse=True)
def _described_once():
    """Describing the options of a command takes most of a parse: each is described once, and not for each line."""
    describe, adapter, described, adapters = cyclopts.App.assemble_argument_collection, pydantic.TypeAdapter, {}, {}

    def fresh(app, **how):
        # Beside each stays what it is of: its `id` is of no other.
        key = (id(app), *how.items())
        if key not in described:
            described[key] = describe(app, **how), app
        first = described[key][0]
        made = first.copy(reset_tokens=True)
        new = {id(old): each for old, each in zip(first, made, strict=True)}
        for each in made:
            each.children = type(made)(new[id(child)] for child in each.children)
        return made

    class Once(adapter):
        __class_getitem__ = adapter.__class_getitem__

        def __new__(cls, hint, **how):
            if how:
                return adapter(hint, **how)
            if id(hint) not in adapters:
                adapters[id(hint)] = adapter(hint), hint
            return adapters[id(hint)][0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cyclopts.App, "assemble_argument_collection", fresh)
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
