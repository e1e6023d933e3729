"""The package as it is installed from a wheel, into an environment of its own beside the libraries of this one."""

import os
import shlex
import subprocess
import sys
import venv
import zipfile
from pathlib import Path
from sysconfig import get_path

import pytest

ROOT = Path(__file__).parents[1]
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built as pip builds it, but with the hatchling of this environment, which needs no network."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([*PIP, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, ROOT], check=True)
    (made,) = folder.glob("midair-*.whl")
    return made


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """The programs of an environment that has the wheel and no other midair, not that of this folder either."""
    own = tmp_path_factory.mktemp("installed")
    venv.create(own)
    programs = own / ("Scripts" if os.name == "nt" else "bin")
    subprocess.run([*PIP, "--python", programs / "python", "install", "--no-deps", wheel], check=True)
    packages = next(own.glob("**/site-packages"))
    # A folder that a .pth file names is looked through, but its own .pth files are not: what is editable stays out.
    (packages / "libraries.pth").write_text(get_path("purelib") + "\n", encoding="utf-8")
    return programs


def typed(programs, line, folder):
    """What came of a command line, typed in a folder that has nothing to do with ours."""
    words = shlex.split(line)
    outside = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    command = [programs / words[0], *words[1:]]
    return subprocess.run(command, cwd=folder, env=outside, stdin=subprocess.DEVNULL, capture_output=True, text=True)


@pytest.mark.long
def test_every_file_of_the_package_is_in_the_wheel(wheel):
    """Pages, scripts, templates, samples with their licences, the solved one, plans of studies, exposure's limits."""
    src = ROOT / "src"
    ours = {path.relative_to(src).as_posix() for path in (src / "midair").rglob("*") if path.is_file()}
    wanted = {name for name in ours if "__pycache__" not in name}
    packed = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert packed == wanted
    assert {Path(name).suffix for name in packed} >= {".html", ".css", ".js", ".j2", ".csv", ".wav", ".h5", ".toml"}


@pytest.mark.slow
def test_it_is_the_wheel_that_answers(installed, tmp_path):
    """With what it packs: samples, devices and limits of exposure."""
    done = typed(installed, 'python -c "import midair; print(midair.__file__)"', tmp_path)
    assert Path(done.stdout.strip()).is_relative_to(installed.parent), done.stderr
    for line in ("midair gallery towel", "midair play towel.h5 --mode quick --duration 0.1s", "midair study new touch"):
        done = typed(installed, line, tmp_path)
        assert done.returncode == 0, (line, done.stderr)
