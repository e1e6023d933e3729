"""The benchmarks: that those which docs name are there, and that they run, in the smallest form that says anything."""

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NO_PROGRAMS = {
    "clock",
    "empty_studies",
    "exposure_attacks",
    "live_outside",
    "palm_floor",
    "published",
    "studio_deaths",
    "studio_delays",
    "targets",
    "yardstick",
    "peers",
    "real_pressure",
    "sequence",
    "static",
    "standstill",
}
"""What the others are made of."""
PROGRAMS = sorted(
    path.stem for path in (ROOT / "benchmarks").glob("*.py") if path.stem[0] != "_" and path.stem not in NO_PROGRAMS
)

SMALLEST = {
    "benchmarks": ["--others", "0", "--strengths", ".1", "--no-peers", "--methods", "naive", "--part", "static"],
    "benchmarks.recordings": ["--length", ".05", "--plain-frames", "2", "--part", "paper", "best", "jobs", "live"],
    "benchmarks.limits": ["--frames", "40"],
    "benchmarks.terms": ["--part", "bits", "--strengths", ".1"],
    "benchmarks.playback": ["--seconds", ".02", "--rate", "4000"],
    "benchmarks.air": ["--heights", ".2", "--duration", ".002"],
    "benchmarks.reels": ["--rows", "small 0.1"],
    "benchmarks.palm": [
        *("--part", "table", "ears", "floor", "--things", "noise", "denim", "--ways", "finest", "--duration", ".06"),
        *("--units", "4", "--strengths", ".1", "--starts", "1", "--frames", "8", "--iterations", "9"),
    ],
    "benchmarks.palm_pose": [
        *("--part", "table", "exposure", "--things", "towel", "--poses", "solved", "10 up", "--duration", ".03"),
        *("--drives", "2", "--random-poses", "3", "--data", "none"),
    ],
    "benchmarks.palm_pictures": ["FOLDER", "--duration", ".03", "--pitch", ".005"],
    "benchmarks.live": ["--part", "bands", "run", "--frames", "1000", "--priority", "0"],
    "benchmarks.loss": ["--plays", "1", "--seconds", "2"],
    "benchmarks.scale": ["--sizes", "1 4"],
    "benchmarks.studies": ["--studies", "2", "--part", "ratings", "errors", "--trials", "48"],
    "benchmarks.studio": ["--seconds", "2", "--part", "rooms"],
    "benchmarks.sweeps": ["--count", "4", "--chunk", "2", "--workers", "1"],
}


def test_a_benchmark_says_what_it_prints(monkeypatch, capsys):
    pytest.importorskip("threadpoolctl")
    monkeypatch.syspath_prepend(str(ROOT))
    for name in PROGRAMS:
        program = importlib.import_module(f"benchmarks.{name}")
        monkeypatch.setattr(sys, "argv", [name, "--help"])
        with pytest.raises(SystemExit) as ended:
            program.main()
        assert ended.value.code == 0, name
        assert f"benchmarks.{name}" in capsys.readouterr().out


def test_every_benchmark_that_a_page_or_make_names_is_there():
    pages = [ROOT / "README.md", ROOT / "Makefile", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    named = {name for page in pages for name in re.findall(r"benchmarks\.([a-z_]+)", page.read_text(encoding="utf-8"))}
    assert named - {"py", "json"} <= {path.stem for path in (ROOT / "benchmarks").glob("*.py")}


def test_make_bench_has_a_smallest_form_of_each_part():
    made = re.search(r"^bench:.*?\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert made is not None
    assert set(re.findall(r"-m (benchmarks\S*)", made[1])) <= set(SMALLEST)


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALLEST)
def test_a_benchmark_runs_to_its_end(name, tmp_path):
    words = [str(tmp_path) if word == "FOLDER" else word for word in SMALLEST[name]]
    done = subprocess.run([sys.executable, "-m", name, *words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) >= 3
