"""Every block of code of README and docs is run by a test, or named here with what it needs."""

import glob
import re
import shlex
import tomllib
from dataclasses import replace
from itertools import chain
from pathlib import Path
from shutil import copyfile

import numpy as np
import pytest
import soundfile
from tests.printed import PAGES, ROOT, blocks, fenced, not_printed

from midair.cli import run
from midair.files import (
    load_palm,
    load_placement,
    load_sensor,
    load_tracker,
    open_take,
    save,
    save_calibration,
    save_palm_path,
)
from midair.model import Crosstalk, PalmPath, Recording
from midair.patterns import load_pattern
from midair.recordings import cut
from midair.settings import Settings

HERE = ("docs/live.md",)
"""Pages whose commands tests/test_docs.py runs, since their Python reads what these have written."""

ROWS_OF_NEEDS = Path(__file__).with_name("docs_needs.txt").read_text(encoding="utf-8").splitlines()
NEEDS = dict(row.split(" | ") for row in ROWS_OF_NEEDS if row and not row.startswith("#"))
"""Beginnings of lines that no test types, and what they need."""

SHORTER = {"--duration 1s": "--duration 20ms", "calibrate bench lab": "calibrate bench lab --duration 6s"}
"""What is typed in place of what is printed, since it takes minutes."""


def typed(page):
    """Every line that a page's consoles show to be typed; what a program answers is left out."""
    for language, text in fenced(page):
        if language not in ("console", "plain"):
            continue
        lines = text.replace("\\\n", " ").splitlines()
        prompts = any(line.startswith("$ ") for line in lines)
        for line in lines:
            if line.startswith("$ ") or (language == "console" and not prompts):
                yield " ".join(re.sub(r"\s#\s.*", "", line.removeprefix("$ ")).split())


def needed(line):
    return max((name for name in NEEDS if line.startswith(name)), key=len, default=None)


RUN = [page for page in PAGES if page not in HERE and any(not needed(line) for line in typed(page))]
"""Pages whose commands are run below."""


def test_no_line_is_neither_run_nor_named():
    lines = [line for page in PAGES for line in typed(page)]
    assert [line for line in lines if not needed(line) and not line.startswith("midair ")] == []
    assert {needed(line) for line in lines} - {None} == set(NEEDS)
    assert set(RUN) == set(PREPARED)


def of_settings(path):
    made = Settings.load(path)
    return made.target.mapping, made.target.grid.height, made.solver.guard.margin


TOMLS = {
    "docs/build-a-sensor.md": [(lambda path: load_sensor(path).grid.shape, (4, 4))],
    "docs/draw.md": [(lambda path: load_pattern(path).foci().frames > 0, True)] * 4,
    "docs/follow.md": [(lambda path: load_tracker(path).offset[2], 0.015)],
    "docs/palm.md": [(lambda path: load_palm(path).name, "left hand")],
    "docs/play-on-your-array.md": [(lambda path: len(load_placement(path).array().position), 2 * 249)],
    "docs/plug-ins.md": [None],
    "docs/settings.md": [(of_settings, ("slow-bias", 0.18, 0.025))],
    "docs/study.md": [None, None, None],
}
"""What reads each block of TOML, and a value of it; those of studies are drawn in tests/test_docs.py, and
tests/test_plug_ins.py makes a package of docs/plug-ins.md."""


def test_every_toml_is_what_its_page_says(tmp_path):
    found = {page: blocks(page, "toml") for page in PAGES}
    assert {page: len(texts) for page, texts in found.items() if texts} == {
        page: len(readers) for page, readers in TOMLS.items()
    }
    for page, readers in TOMLS.items():
        for known, text in zip(readers, found[page], strict=True):
            assert tomllib.loads(text)
            (tmp_path / "a.toml").write_text(text, encoding="utf-8")
            assert known is None or known[0](tmp_path / "a.toml") == known[1], page


def take(name="take.h5"):
    """A tenth of a second of a towel on the virtual sensor."""
    if not Path("whole.h5").exists():
        assert run(["record", "virtual:towel", "whole.h5", "--duration", "0.6s"]) == 0
    whole = open_take("whole.h5")
    save(cut(whole.recording, 0.5, 0.6), name, calibration=whole.calibration)


def a_fabric():
    time = np.arange(200) / 100
    rows = np.column_stack([time, *np.sin(2 * np.pi * np.outer([30, 20, 10], time))])
    np.savetxt("fabric.csv", rows, delimiter=",", header="time,accel_x,accel_y,accel_z", comments="")
    gaps = np.random.default_rng(0).normal(size=(1000, 4, 4))
    gaps[500:504, 1, 1] = np.nan
    np.save("sensor.npy", gaps)


def a_bench():
    """Takes as the page names them, of the bench that it begins with; a tone; what a beam and codes have measured."""
    take()
    whole = open_take("whole.h5")
    crosstalk = Crosstalk(matrix=np.eye(16), uncertainty=np.full((16, 16), 0.01))
    save_calibration(replace(whole.calibration, crosstalk=crosstalk), "palm-3-2026-11-21.calibration.h5")
    assert run(["calibrate", "beam", "--output", "beam.calibration.h5"]) == 0
    grid = open_take("whole.h5").recording.sensor
    tone = 0.02 * 10 * np.sqrt(2) * np.sin(2 * np.pi * 250 * np.arange(4000) / 1000)
    noise = 1e-4 * np.random.default_rng(0).normal(size=(4000, *grid.shape))
    save(Recording(samples=tone[:, None, None] + noise, rate=1000.0, sensor=grid), "tone.h5")
    assert run(["calibrate", "array", "virtual", "mine.array.h5"]) == 0


def of_the_lab():
    """What the bench wrote, under the names of the next command."""
    for path in Path("lab").glob("*.h5"):
        stem = path.stem
        name = f"ref-{stem.removesuffix('-reference')}.h5" if stem.endswith("-reference") else f"{stem}.h5"
        copyfile(path, name)


def with_a_drive():
    take()
    assert run(["solve", "take.h5", "--mode", "quick", "--duration", "30ms"]) == 0
    still = {"centre": [[0, 0, 0.2]], "normal": [[0, 0, -1]], "fingers": [[0, 1, 0]], "confidence": [1.0]}
    path = PalmPath(time=np.arange(100) / 100, **{name: np.repeat(each, 100, axis=0) for name, each in still.items()})
    save_palm_path(path, "hand.csv")


def patterns():
    circle, *_, sized = blocks("docs/draw.md", "toml")
    for name, text in (("circle.toml", circle), ("sized.toml", sized)):
        Path(name).write_text(text.replace("_s = 1.0 ", "_s = 0.1 "), encoding="utf-8")
    copyfile(ROOT / "tests" / "patterns" / "adaptics" / "Rain.adaptics", "rain.adaptics")


def with_a_rerecording():
    assert run(["record", "virtual:towel", "take.h5", "--duration", "0.2s"]) == 0
    copyfile("take.h5", "take.rerecorded.h5")
    few = ["--set", "target.grid.rows=4", "--set", "target.grid.columns=4", "--set", "target.grid.pitch=0.011"]
    coarse = ["--mode", "quick", "--duration", "0.1s", *few, "--set", "solver.guard=0.0"]
    assert run(["solve", "take.h5", *coarse]) == 0


def an_old_table():
    """Answers of an experiment that was not made with midair."""
    rng = np.random.default_rng(1)
    rows = [
        f"p{person},p{person},{shown},{shown},{rng.choice([shown, 'towel'])},{surface},{asked},{rng.integers(1, 8)}"
        for person in range(4)
        for surface in ("plain", "grooved")
        for shown in ("brush", "towel", "sponge")
        for asked in ("brush", "towel")
    ]
    names = "participant,subject,object,presented,response,surface,rated,score"
    Path("old.csv").write_text("\n".join([names, *rows]) + "\n")


PREPARED = {
    "docs/air.md": take,
    "docs/bring-your-own.md": a_fabric,
    "docs/calibrate.md": a_bench,
    "docs/draw.md": patterns,
    "docs/error-budget.md": take,
    "docs/exposure.md": with_a_drive,
    "docs/fidelity.md": take,
    "docs/follow.md": with_a_drive,
    "docs/install.md": None,
    "docs/palm.md": with_a_drive,
    "docs/play-on-your-array.md": with_a_drive,
    "docs/record.md": None,
    "docs/settings.md": lambda: (take(), Settings().save("take.toml")),
    "docs/show.md": with_a_rerecording,
    "docs/start.md": None,
    "docs/study.md": an_old_table,
    "docs/sweep.md": lambda: (take("towel.h5"), take("brush.h5")),
    "docs/touches.md": None,
    "docs/tutorial.md": None,
}
"""What a reader has before the page begins."""

AFTERWARDS = {"midair calibrate bench lab": of_the_lab}


LONGEST = {f"docs/{name}.md" for name in ("air", "calibrate", "error-budget", "settings", "start", "sweep", "tutorial")}
"""Pages that take more than a minute."""


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=pytest.mark.slow if page in LONGEST else pytest.mark.long) for page in RUN]
)
def test_every_command_of_a_page_prints_what_the_page_shows(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    if PREPARED[page] is not None:
        PREPARED[page]()
    printed = ""
    for line in typed(page):
        if needed(line):
            continue
        short = line
        for long, instead in SHORTER.items():
            short = short.replace(long, instead)
        words = chain.from_iterable(sorted(glob.glob(word)) or [word] for word in shlex.split(short)[1:])
        status = run(list(words))
        said = capsys.readouterr()
        assert status == 0, (line, said.err)
        printed += said.out
        AFTERWARDS.get(line, lambda: None)()
    assert not_printed(page, printed) == []


README = (ROOT / "README.md").read_text(encoding="utf-8")
BEFORE_THE_ROWS = re.findall(r"^.*A few things to start from, once `(midair [^`]+)`", README, re.MULTILINE)
ROWS = re.findall(r"^\| .* \| `(midair [^`]+)` \|$", README, re.MULTILINE)
"""What README says to type, before its table and in it."""

OF_HARDWARE = {
    'midair record "lsl:Skin?unit=V" --object towel --repeats 5': "a sensor over LSL",
    "midair play take.drive.h5 --device autd3": "an array",
    "midair serve --device autd3": "an array",
}


def test_the_rows_of_the_readme_that_need_hardware_are_named_and_their_extras_are_there():
    assert (len(BEFORE_THE_ROWS), len(ROWS)) == (1, 13)
    assert set(OF_HARDWARE) < set(ROWS)
    said = re.search(r'--editable "\.\[([a-z0-9,]+)\]"`\.', README)
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert set(said[1].split(",")) <= set(extras)


@pytest.mark.slow
def test_every_row_of_the_readme_does_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    take()
    soundfile.write("towel.wav", np.random.default_rng(0).uniform(-1, 1, 2000), 1000)
    for line in ROWS:
        if line in OF_HARDWARE:
            continue
        # The published iterations of Levenberg-Marquardt take minutes.
        words = shlex.split(line.replace("--method lm", "--method lm --set solver.iterations=[2,1]"))[1:]
        assert run(words) == 0, (line, capsys.readouterr().err)
    assert Path("again.drive.h5").exists()
