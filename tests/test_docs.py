"""What README and docs print to be typed runs as it is printed."""

import dataclasses
import doctest
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.printed import PAGES, ROOT, blocks, not_printed

import midair
from midair.cli import app, run
from midair.cli.commands import COMMANDS, FOLDERS
from midair.settings import CHOICES, MODES
from midair.study import Design, SilentPresenter, StudyFolder, read_design, template_text
from midair.study.design.plan import draw_plan
from midair.study.design.question import Question, Stimulus
from midair.study.design.session_state import replay
from midair.study.design.study_design import Block, Exclusions
from midair.study.session.event_log import read_events


def commands(page):
    """Every midair command that a page's consoles show, without its comment."""
    lines = [line for block in blocks(page, "console") for line in block.splitlines()]
    said = [line.removeprefix("$ ").split("#")[0] for line in lines]
    return [shlex.split(line)[1:] for line in said if line.startswith("midair ")]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.long
def test_the_script_of_the_readme_is_short_and_prints_how_close_it_came(folder, capsys):
    (script,) = blocks("README.md", "python")
    assert len(script.splitlines()) <= 15
    exec(script, names := {})
    lines = re.findall(r"^E ([\d.]+) %, correlation ([\d.]+), gain ([\d.]+)$", capsys.readouterr().out, re.MULTILINE)
    (_, first, low), (error, last, right) = (map(float, each) for each in lines)
    assert error < 1
    assert min(first, last) > 0.995
    assert (low, right) == (0.8, 1.0)
    assert names["close"].gain == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(
    ("page", "holds"),
    [
        ("air", lambda names: 0 < names["worst"] < 0.05),
        ("settings", bool),
        pytest.param("show", lambda names: names["page"].startswith("<!doctype html>"), marks=pytest.mark.long),
        pytest.param("start", lambda names: names["played"].take.recording.frames > 30, marks=pytest.mark.long),
        # A tenth of a second at 4 kHz, and .15 s before and after it.
        pytest.param(
            "tutorial",
            lambda names: (names["field"].shape, names["played"].take.recording.frames) == ((1600, 256), 420),
            marks=pytest.mark.long,
        ),
    ],
)
def test_the_python_of_a_page_runs(page, holds, folder):
    if page == "tutorial":
        assert run(["record", "virtual:towel", "stroke.h5"]) == 0
    for script in blocks(f"docs/{page}.md", "python"):
        exec(script.replace("cut(0.4, 0.1)", "cut(0.4, 0.03)") if page == "start" else script, names := {})
        assert holds(names)


def test_the_page_on_trackers_reads_a_pose(folder):
    Path("hand.csv").write_text("time,x,y,z,nx,ny,nz,dx,dy,dz,confidence\n0,0,0.1,0.2,0,0,-1,0,1,0,1\n")
    Path("leap.toml").write_text(blocks("docs/follow.md", "toml")[0])
    (script,) = blocks("docs/follow.md", "python")
    exec(script, names := {})
    assert names["pose"].centre[0] == pytest.approx([0, -0.22, 0.215])
    assert names["lines"] == []


def test_the_doctests_of_the_sensor_page_hold():
    text = "\n".join(blocks("docs/build-a-sensor.md", "python"))
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner()
    runner.run(parser.get_doctest(text, {}, "build-a-sensor", None, 0))
    assert runner.summarize(verbose=False).failed == 0
    assert runner.tries > 0


def test_the_plans_of_the_page_on_studies_can_be_drawn(folder):
    first, fragment, markers = blocks("docs/study.md", "toml")
    plan = draw_plan(read_design(f"{first}\n{markers}"))
    assert plan.design.markers is not None
    assert len(plan.of(1)) == 40
    names = ["weak", "middle", "strong"]
    sides = "\n".join(
        f'[[stimuli]]\nname = "{name}_{side}"\nsource = "x.drive.h5"\n'
        f'levels = {{ amplitude = "{2**at}", place = "{side}" }}'
        for at, name in enumerate(names)
        for side in ("left", "right")
    )
    where = '[[questions]]\nname = "where"\nkind = "choice"\ntext = "?"\noptions = ["left", "right"]\ntruth = "place"'
    threshold = draw_plan(read_design(f'name = "t"\nparticipants = 1\nseed = 1\n{where}\n{sides}\n{fragment}'))
    assert [trial.variant for trial in threshold.trials].count(0) == 20


def test_every_part_of_a_plan_that_the_page_on_studies_names_is_one():
    kinds = {"plan": Design, "exclusions": Exclusions, "question": Question, "block": Block, "stimulus": Stimulus}
    page = (ROOT / "docs" / "study.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (plan|`\[exclusions\]`|question|block|stimulus) \| (.*?) \|", page, re.MULTILINE)
    named = [(where.strip("`[]"), name) for where, cell in rows for name in re.findall(r"`\[*(\w+)", cell)]
    assert len(named) > 20
    for where, name in named:
        assert name in {field.name for field in dataclasses.fields(kinds[where])}, (where, name)


def test_the_runner_of_the_page_on_studies_runs(folder):
    script = next(one for one in blocks("docs/study.md", "python") if "with Session(" in one)
    design = read_design(template_text("paper").replace("repetitions = 4", "repetitions = 1"), participants=3)
    plan, told = draw_plan(design), []
    names = {"plan": plan, "folder": StudyFolder(folder), "presenter": SilentPresenter(), "show": told.append}
    exec(script, names | {"ask": lambda text: "AB12" if "pseudonym" in text else "1"})
    found = replay(read_events(folder / "sessions" / "sub-03.jsonl"), plan, 3)
    assert found.next_trial == len(found.trials)
    assert ({given.by for given in found.answers.values()}, told[:2]) == ({"page"}, ["Feel now.", ""])


def test_the_table_of_settings_has_every_choice_in_every_mode():
    table = runpy.run_path(str(ROOT / "docs" / "reference.py"))["choices_table"]()
    assert "| `solver.guard.margin` |  | default | 25mm |  |  |  |" in table
    assert all(f"`--{choice.name}`" in table for choice in CHOICES)
    assert "`target.rate`<br>`--rate` | Drive frame rate. | 1000Hz | 4000Hz | 1333.33Hz |  |  |" in table
    assert "| lm | glide |  |  | free |" in table
    assert set(MODES) == {"paper", "best", "quick", "finest", "quiet"}


OFFERED = {*COMMANDS, *FOLDERS}


def test_every_option_that_a_page_names_is_one():
    """Each `midair COMMAND ... --option` of a page names a command and options that are there."""
    wrong, known = [], {}
    shown = re.compile(r"(?:`|^\$ |^)(midair [a-z][^`\n]*)", re.MULTILINE)
    lines = [(each, line) for each in PAGES for line in shown.findall((ROOT / each).read_text(encoding="utf-8"))]
    for page, line in lines:
        words = line.split()[1:]
        name = [word for word in words[:2] if re.fullmatch(r"[a-z]+", word)]
        names = name if name[:1] and name[0] in FOLDERS else name[:1]
        if not names or names[0] not in OFFERED:
            continue
        command = app[names[0]]
        if len(names) > 1 and names[1] in command:
            command = command[names[1]]
        if id(command) not in known:
            known[id(command)] = {each for one in command.assemble_argument_collection() for each in one.names}
        options = set(re.findall(r"(?<!\S)--[a-z][a-z-]*", line)) - {"--help", "--verbose", "--all"}
        wrong += [f"{page}: {option} of {line}" for option in options - known[id(command)]]
    assert known
    assert wrong == []


@pytest.mark.clock
@pytest.mark.long
def test_the_page_of_live_runs(folder, capsys):
    for tokens in commands("docs/live.md"):
        assert run(tokens) == 0, tokens
    assert not_printed("docs/live.md", capsys.readouterr().out) == []
    script, reading = blocks("docs/live.md", "python")
    (folder / "touch.py").write_text(script, encoding="utf-8")
    done = subprocess.run([sys.executable, "touch.py"], capture_output=True, text=True, check=True, cwd=folder)
    assert done.stdout.startswith("1000 ")
    exec(reading, {})


@pytest.mark.long
def test_each_call_of_the_tasks_in_python_runs(folder):
    text = (ROOT / "docs" / "how-to.md").read_text(encoding="utf-8").partition("## In Python")[2]
    calls = re.findall(r"^\| .* \| `([^`]+)` \|$", text, re.MULTILINE)
    assert len(calls) == len(re.findall(r"^\| (?!you)[^-]", text, re.MULTILINE))
    midair.record("virtual:towel", 0.6, path="take.h5")
    names = {"midair": midair, "values": np.zeros((10, 4, 4))}
    for call in calls:
        exec(call, names)
    assert all(Path(name).exists() for name in ("part.png", "phases.csv", "part.h5", "best.drive.h5"))
