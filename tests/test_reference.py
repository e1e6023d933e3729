"""Every public name and every command stands in the reference; code in the docs runs, or is known not to."""

import ast
import dataclasses
import importlib
import importlib.util
import pkgutil
import re
import sys

import pytest
from tests.printed import PAGES, ROOT, blocks

import midair
from midair.cli import run
from midair.cli.commands import COMMANDS, FOLDERS
from midair.cli.commands.play import PlayOptions
from midair.rig import LiveSettings, PlaySettings, RecordSettings


@pytest.fixture(scope="module")
def reference():
    spec = importlib.util.spec_from_file_location("reference", ROOT / "docs" / "reference.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def test_every_public_name_of_every_module_is_documented(reference):
    found = reference.modules()
    open_modules = {each.name for each in pkgutil.iter_modules(midair.__path__)} - reference.CLOSED
    assert {name.partition(".")[2] for name in found} - {""} == open_modules
    assert sum(map(len, found.values())) > 700
    for name, names in found.items():
        module = sys.modules[name]
        page = reference.module_page(name, names)
        documented = set(
            re.findall(rf"^\.\. (?:autoclass|autofunction|py:data):: {re.escape(name)}\.(\w+)$", page, re.MULTILINE)
        )
        documented |= {each for _, each in re.findall(r"^- :py:class:`~([\w.]+)\.(\w+)`: \S", page, re.MULTILINE)}
        assert documented == set(names), name
        assert all(hasattr(module, each) for each in names), name


def test_the_first_page_lists_each_module_and_a_class_is_described_once(reference, tmp_path, monkeypatch):
    monkeypatch.setattr(reference, "command_page", str)
    reference.write(tmp_path)
    first = (tmp_path / "index.rst").read_text(encoding="utf-8")
    for name in reference.modules():
        assert re.search(rf"^:doc:`{re.escape(name)}`\n   \w.+", first, re.MULTILINE), name
    assert ".. autoclass" not in (tmp_path / "midair.rst").read_text(encoding="utf-8")
    assert "autoclass:: midair.model.Recording" in (tmp_path / "midair.model.rst").read_text(encoding="utf-8")


@pytest.mark.long
def test_the_page_of_commands_has_every_command_and_its_help(reference):
    page = reference.command_page()
    assert all(f"## `midair {name}`" in page for name in (*COMMANDS, *FOLDERS))
    assert page.count("Usage: midair") >= page.count("\n## `")


@pytest.mark.long
def test_the_tables_of_settings_have_every_field_and_every_option(reference, capsys):
    for kind, options, command in (
        (RecordSettings, None, "record"),
        (PlaySettings, PlayOptions, "play"),
        (LiveSettings, None, "live"),
    ):
        table = reference.declared_table(kind, options)
        assert all(f"| `{one.name}` |" in table for one in dataclasses.fields(kind))
        run([command, "--help"])
        shown = capsys.readouterr().out
        typed = re.findall(r"`(--[a-z-]+)`", table)
        assert len(typed) > 5
        assert [each for each in typed if f"{each} " not in shown] == []


RUN = {
    "README.md": 1,
    "docs/air.md": 1,
    "docs/build-a-sensor.md": 2,
    "docs/follow.md": 1,
    "docs/live.md": 2,
    "docs/plug-ins.md": 2,
    "docs/remote.md": 1,
    "docs/settings.md": 2,
    "docs/show.md": 1,
    "docs/start.md": 1,
    "docs/study.md": 1,
    "docs/tutorial.md": 1,
}
"""How many blocks of Python of each page tests run (docs, plug_ins, rig/remote, devices/sensors/lsl)."""

NOT_RUN = {
    "docs/calibrate.md": (1, "takes of the reader's own sensor and reference"),
    "docs/record.md": (1, "a sensor over LSL"),
    "docs/study.md": (1, "answers of people"),
    "docs/sweep.md": (2, "a cluster, and hours"),
}
"""The others, and what they need."""


def test_every_block_of_python_runs_in_a_test_or_is_known_not_to():
    found = {page: len(blocks(page, "python")) for page in PAGES}
    known = {page: RUN.get(page, 0) + NOT_RUN.get(page, (0, ""))[0] for page in PAGES}
    assert found == known


def test_every_name_of_midair_in_a_block_of_python_is_there():
    for block in (block for page in PAGES for block in blocks(page, "python")):
        code = block if ">>>" not in block else "\n".join(re.findall(r"^(?:>>>|\.\.\.) ?(.*)$", block, re.MULTILINE))
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("midair"):
                module = importlib.import_module(node.module)
                assert [each.name for each in node.names if not hasattr(module, each.name)] == []
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "midair":
                assert hasattr(midair, node.attr), node.attr
