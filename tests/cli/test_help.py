"""What help shows: every command has an example, each of them does what it says, and no line is cut off."""

import inspect
import os
import shlex
import shutil
import subprocess
import sys
from contextlib import chdir
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from cyclopts import CycloptsError
from rich.console import Console

from midair.cli import app, run
from midair.cli.commands import COMMANDS, summary_of
from midair.cli.console import parse_flags
from midair.cli.help_text import GROUPS, examples_of
from midair.files import save
from midair.model import Recording


def commands(at=app, names=()):
    for name in at:
        if not name.startswith("-"):
            yield (*names, name), at[name]
            yield from commands(at[name], (*names, name))


ADAPTICS = Path(__file__).parents[1] / "patterns" / "adaptics"
ALL = dict(commands())
EXAMPLES = [line for below in ALL.values() if below.default_command for line in examples_of(below.default_command)]
HARDWARE = [
    'midair record "lsl:Skin?unit=V" --object towel --repeats 5',
    "midair play take.drive.h5 --device autd3",
    "midair calibrate tracker leap: leap.toml --device autd3",
    "midair stop --watch serial:/dev/ttyUSB0",
    'midair live --sensor "lsl:Skin?unit=V" --calibration skin.calibration.h5 --device autd3 --level 0.3',
    "midair live --device autd3 --follow leap: --tracker-latency 12ms",
]
"""These need a sensor, an array or a switch."""
SHELL = [line for line in EXAMPLES if line.startswith("eval") or " > " in line]
"""These are for a shell; `test_completion` runs what is in them."""
SERVED = [line for line in EXAMPLES if line.startswith(("midair studio", "midair serve"))]
"""These run until stopped; `tests/studio/test_browser.py` opens them, and `tests/rig/test_remote.py` plays."""
ELSEWHERE = ("demo", "loop", "budget", "paper --fidelity", "calibrate array", "calibrate beam")
"""These take minutes; their own slow tests and the pages of the docs run them."""
PLAN = "study new touch --participants 2 --drives none"
BEFORE = {
    "calibrate measure": ["calibrate bench bench --duration 12s"],
    "study run": [PLAN],
    "study withdraw": [PLAN, "study run touch --simulate"],
    "study analyse": [PLAN, "study run touch --simulate"],
    "study export": [PLAN, "study run touch --simulate"],
    "sweep report": ["sweep patterns patterns.sweep --count 1000 --strength 0.1"],
}
"""Commands to run before an example."""
HERE = [line for line in EXAMPLES if line not in (*HARDWARE, *SHELL, *SERVED)]
RUN = [line for line in HERE if not line.removeprefix("midair ").startswith(ELSEWHERE)]


def test_every_command_is_in_a_group_and_has_an_example_that_names_it():
    assert {below.group[0].name for names, below in ALL.items() if len(names) == 1} == set(GROUPS)
    for names, below in ALL.items():
        assert "midair " in below.help_epilogue, names
        if below.default_command is not None:
            examples = examples_of(below.default_command)
            assert examples, names
            assert all(f"midair {' '.join(names)}" in line for line in examples), names


def test_help_fits_and_loses_nothing():
    """In a narrow terminal; the longest page in wider ones too, and in a hundred lines of 80 columns."""
    wrong = []
    pages = [(60, names) for names in [(), *ALL]] + [(width, ("solve",)) for width in (80, 200)]
    for width, names in pages:
        page = StringIO()
        app.help_print(list(names), console=Console(file=page, width=width))
        if width == 80 and len(page.getvalue().splitlines()) > 100:
            wrong.append((names, width, "too long"))
        examples = examples_of(ALL[names].default_command) if names and ALL[names].default_command else ()
        shown = "".join(page.getvalue().replace("\\\n", "").split())
        if max(map(len, page.getvalue().splitlines())) > width or "…" in shown:
            wrong.append((names, width, "too wide"))
        wrong += [(names, width, line) for line in examples if "".join(line.split()) not in shown]
    assert wrong == []


def refusal(line):
    try:
        app.parse_args(parse_flags(shlex.split(line)[1:])[1], exit_on_error=False, print_error=False)
    except CycloptsError as wrong:
        return str(wrong)
    return None


def test_every_example_can_be_parsed():
    assert len(HERE) > 70
    assert {line: why for line in EXAMPLES if line not in SHELL and (why := refusal(line))} == {}
    assert refusal("midair cut take.h5 --nothing 3")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    import soundfile

    folder = tmp_path_factory.mktemp("examples")
    rng = np.random.default_rng(3)
    samples = rng.normal(size=(1000, 4, 4)) * np.hanning(1000)[:, None, None]
    with chdir(folder):
        save(Recording(samples=samples, rate=1000), "take.h5")
        rows = np.column_stack([np.arange(1000) / 1000, samples.reshape(1000, 16)])
        rows[500:503, 4] = np.nan
        names = ",".join(["time", *(f"ch{n}" for n in range(16))])
        np.savetxt("gaps.csv", rows, delimiter=",", header=names, comments="", fmt="%.6f")
        shutil.copy(ADAPTICS / "Rain.adaptics", "rain.adaptics")
        (folder / "circle.toml").write_text("duration_s = 0.1\n[[spot]]\nshape = 'circle'\ndraw_hz = 50")
        trials = "".join(f"{n},{n % 2},{n % 2},{person}\n" for person in ("a", "b", "c") for n in range(8))
        (folder / "psychopy.csv").write_text(f"trials.thisN,object,key_resp.keys,participant\n{trials}")
        soundfile.write("towel.wav", 0.5 * np.clip(rng.normal(size=4000) / 4, -1, 1), 8000)
        assert run(["cut", "take.h5", "stroke.h5", "--start", "0.5s", "--end", "0.56s"]) == 0
        for name in ("take.h5", "stroke.h5"):
            assert run(["calibrate", name, "--peak", "30Pa"]) == 0
        assert run(["cut", "take.h5", "part.h5", "--start", "0.5s", "--end", "0.52s"]) == 0
        paper = ["--mode", "paper", "--method", "fast", "--lead", "0s", "--duration", "0.03s"]
        assert run(["solve", "take.h5", *paper]) == 0
        assert run(["play", "take.drive.h5"]) == 0
        os.rename("take.rerecorded.h5", "kept.h5")
    return folder


@pytest.mark.long
@pytest.mark.parametrize("command", dict.fromkeys(line.split()[1] for line in RUN))
def test_the_examples_of_a_command_run(made, tmp_path, monkeypatch, subtests, command):
    for number, line in enumerate(line for line in RUN if line.split()[1] == command):
        monkeypatch.chdir(shutil.copytree(made, tmp_path / str(number)))
        words = shlex.split(line)[1:]
        if "take.rerecorded.h5" in words:
            Path("kept.h5").rename("take.rerecorded.h5")
        for gone in {"solve": ["take.drive.h5"], "cut": ["part.h5"]}.get(words[0], []):
            Path(gone).unlink()
        for before in BEFORE.get(" ".join(words[:2]), []):
            assert run(before.split()) == 0
        with subtests.test(line):
            assert run(words) == 0


@pytest.mark.long
def test_completion_of_a_shell_knows_commands_and_options(capsys):
    for shell in ("zsh", "fish"):
        assert run(["completion", shell]) == 0
        script = capsys.readouterr().out
        assert all(name in script for name in ("record", "solve", "--temperature", "--settings"))


def test_bash_completes_a_command(capsys):
    assert run(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    assert all(name in script for name in ("record", "solve", "--temperature", "--settings"))
    Path("midair.bash").write_text(script, encoding="utf-8")
    asked = (
        "source midair.bash; COMP_WORDS=(midair so); COMP_CWORD=1; COMP_LINE='midair so'; "
        "COMP_POINT=9; $(complete -p midair | sed 's/.*-F \\([^ ]*\\).*/\\1/'); echo ${COMPREPLY[@]}"
    )
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["solve"]


def test_the_summary_is_the_first_line_of_the_docstring():
    own = {name: inspect.getdoc(app[name].default_command).split("\n\n")[0] for name in COMMANDS}
    assert {name: " ".join(first.split()) for name, first in own.items()} == {
        name: summary_of(name) for name in COMMANDS
    }


def test_help_and_version_import_no_command_and_nothing_heavy():
    code = """import sys
from midair.cli import run
heavy = {"numpy", "h5py", "pydantic", "midair.files", "midair.devices", "midair.cli.commands.record"}
for words in ([], ["--version"], ["--help"]):
    assert run(words) == 0
    assert heavy.isdisjoint(sys.modules), words
assert "midair.cli.commands" in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
