"""The benchmarks that docs and make name are there, and run in the smallest form that prints a figure."""

import importlib
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "benchmarks"
SMALLEST = {
    "benchmarks": ["--others", "0", "--strengths", ".1", "--methods", "naive", "--part", "static"],
    "benchmarks.recordings": ["--length", ".05", "--plain-frames", "2", "--part", "paper", "best", "jobs"],
    "benchmarks.playback": ["--seconds", ".02", "--rate", "4000"],
    "benchmarks.air": ["--heights", ".2", "--duration", ".002"],
    "benchmarks.live": ["--part", "bands", "run", "--frames", "1000", "--priority", "0"],
    "benchmarks.studies": ["--studies", "2", "--part", "ratings"],
    "benchmarks.studio": ["--seconds", "2", "--part", "reproduce"],
}


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


def test_make_bench_has_a_smallest_form_of_each_part():
    made = re.search(r"^bench:.*?\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert made is not None
    assert set(re.findall(r"-m (benchmarks\S*)", made[1])) <= set(SMALLEST)


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALLEST)
def test_a_benchmark_runs_to_its_end(name):
    done = subprocess.run(
        [sys.executable, "-m", name, *SMALLEST[name]], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) >= 3
