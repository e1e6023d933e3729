"""The benchmarks that docs and make name are there, and each says what it prints."""

import importlib
import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "benchmarks"


def test_a_benchmark_says_what_it_prints(monkeypatch, capsys):
    pytest.importorskip("threadpoolctl")
    monkeypatch.syspath_prepend(str(ROOT))
    programs = {path.stem: importlib.import_module(f"benchmarks.{path.stem}") for path in FOLDER.glob("[a-z]*.py")}
    for name, program in programs.items():
        if not hasattr(program, "main"):
            continue
        monkeypatch.setattr(sys, "argv", [name, "--help"])
        with pytest.raises(SystemExit) as ended:
            program.main()
        assert ended.value.code == 0, name
        assert f"benchmarks.{name}" in capsys.readouterr().out


def test_programs_that_draw_pictures_of_the_docs_find_their_imports():
    pytest.importorskip("playwright")
    for path in sorted((ROOT / "docs").glob("*_pictures.py")):
        assert runpy.run_path(str(path))


def test_every_benchmark_that_a_page_or_make_names_is_there():
    pages = [ROOT / "README.md", ROOT / "Makefile", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    there = {path.stem for path in FOLDER.glob("*.py")}
    assert set(re.findall(r"-m benchmarks\.([a-z_]+)", text)) <= there
