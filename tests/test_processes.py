import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from tests.hostile import hostile_folder

from midair import processes
from midair.errors import InputError
from midair.processes import protect_command, python_command, safe_path, start_process

SRC = Path(__file__).parents[1] / "src" / "midair"


@pytest.fixture
def hostile(tmp_path, monkeypatch):
    """The current folder is one of a stranger; returns the file of the marks."""
    (folder := tmp_path / "data").mkdir()
    hostile_folder(folder, tmp_path / "marks")
    monkeypatch.chdir(folder)
    return tmp_path / "marks"


def test_a_started_process_imports_nothing_from_the_current_folder(hostile):
    process = start_process(os.getpid, name="x")
    process.join()
    assert (process.exitcode, hostile.exists()) == (0, False)
    assert processes.SAFE_PATH not in os.environ


def test_the_path_is_safe_until_the_last_block_ends(monkeypatch):
    monkeypatch.setenv(processes.SAFE_PATH, "")
    with safe_path():
        with safe_path():
            assert os.environ[processes.SAFE_PATH] == "1"
        assert os.environ[processes.SAFE_PATH] == "1"
    assert os.environ[processes.SAFE_PATH] == ""
    # Python that reads no variables must have one.
    monkeypatch.setattr(sys, "flags", SimpleNamespace(ignore_environment=1, safe_path=False))
    with pytest.raises(InputError, match="python -E: expected"), safe_path():
        pass


def test_the_command_imports_nothing_from_the_current_folder(monkeypatch):
    """`python -m` puts it first."""
    here = os.getcwd()
    for path, left in (([here, "/x"], ["/x"]), (["/x", here], ["/x", here])):
        with monkeypatch.context() as patch:
            patch.setattr(sys, "path", path)
            patch.setenv(processes.SAFE_PATH, "")
            protect_command()
            assert (sys.path, os.environ[processes.SAFE_PATH]) == (left, "1")


def test_one_module_starts_every_python_process():
    starts = re.compile(
        r"sys\.executable|get_context|\b(Process|Pool|ProcessPoolExecutor)\(|os\.(fork|exec|spawn|posix)"
    )
    sources = {path.relative_to(SRC).as_posix(): path.read_text(encoding="utf-8") for path in SRC.rglob("*.py")}
    assert {name for name, text in sources.items() if starts.search(text)} == {"processes.py"}
    runs = {name for name, text in sources.items() if re.search(r"subprocess\.(run|Popen)", text)}
    others = {name for name in runs if "python_command(" not in sources[name]}
    assert others == {"view/film.py"}, "ffmpeg"


COMMANDS = {
    "live": "live --duration 0.3s",
    "a file": "info {folder}/take.h5",
    "sweep": "sweep patterns {folder}/all.sweep --count 2 --iterations 1 --workers 1",
}


@pytest.mark.long
@pytest.mark.parametrize("command", [pytest.param(n, marks=[pytest.mark.clock] * (n == "live")) for n in COMMANDS])
@pytest.mark.parametrize("how", ["midair", "python -m midair", "called by midair"])
def test_no_process_of_a_command_runs_a_data_folder(hostile, tmp_path, command, how):
    from midair.datasets import stroke
    from midair.files import save
    from midair.model import Provenance, Recording

    frames, of = stroke("towel", duration=0.1), Provenance(source="x")
    take = Recording(samples=frames.pressure, rate=frames.rate, sensor=frames.sensor, unit="Pa", provenance=of)
    save(take, tmp_path / "take.h5")
    begin = [str(Path(sys.executable).with_name("midair"))] if how == "midair" else python_command("-m", "midair")
    if how == "python -m midair":
        # Python looks there for these two before midair can change that.
        shutil.rmtree("midair")
        Path("runpy.py").unlink()
        begin.remove("-P")
    words = [*begin, *COMMANDS[command].format(folder=tmp_path).split()]
    state = {"MIDAIR_STATE": str(tmp_path / "state")}
    done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, **state})
    assert (done.returncode, hostile.exists()) == (0, False), done.stderr
