"""Folders of which one file is damaged: studies, tables of other people, sweeps, what a running program leaves."""

import os
from collections.abc import Callable
from pathlib import Path

from midair.datasets import am_stimulus
from midair.files import load_placement, load_profiles, load_sensor
from midair.model import ControlGrid
from midair.settings import Settings
from midair.study import (
    Session,
    SilentPresenter,
    SimulatedParticipant,
    SimulatedScreen,
    StudyFolder,
    analyse,
    answers_table,
    data_of_answers,
    data_of_columns,
    read_bids,
    read_csv,
    read_design,
    run,
    template_text,
    thresholds_of,
    write_bids,
    write_csv,
)
from midair.sweep import load_sweep, sweep_report

ADAPTIVE = """
name = "hand"
participants = 2
seed = 1
questions = [{ name = "felt", kind = "yes-no", text = "Felt?" },
  { name = "rate", kind = "rating", text = "How?", low = 1, high = 7, low_label = "a", high_label = "b" }]
stimuli = [
  { name = "s1", kind = "object", source = "1", levels = { strength = "1" } },
  { name = "s2", kind = "object", source = "2", levels = { strength = "2" } },
  { name = "s3", kind = "object", source = "4", levels = { strength = "4" } },
  { name = "s0", kind = "silence" },
]
[[blocks]]
name = "steps"
stimuli = ["s1", "s2", "s3"]
questions = ["felt"]
repetitions = 12
adaptive = "quest+"
strength = "strength"
extras = [{ role = "catch", stimuli = ["s0"], repetitions = 4 }]

[[blocks]]
name = "all"
stimuli = ["s1", "s2", "s3"]
questions = ["rate"]
"""


def make_folders(folder: Path) -> None:
    study = _study(folder / "study", template_text("paper").replace("repetitions = 4", "repetitions = 1"), "small")
    plan = study.plan()
    answers = answers_table(plan, study.sessions())
    write_bids(answers, plan.design, folder / "bids")
    write_csv(answers, folder / "answers.csv")
    (folder / "design.toml").write_text(template_text("paper"), encoding="utf-8")
    try:
        _study(folder / "adaptive", ADAPTIVE, "adaptive")
    except Exception as wrong:
        raise RuntimeError("the specimen of an adaptive study no longer fits its design") from wrong
    _sweeps(folder)
    state = folder / "state"
    state.mkdir()
    (state / "subject.json").write_text('{"object": "towel", "surface": "wet", "subject": "1"}')
    (state / "playing-1.json").write_text('{"process": 1, "device": "virtual", "port": 9, "secret": "00"}')


def _study(path: Path, text: str, name: str) -> StudyFolder:
    folder = StudyFolder.create(path, text, read_design(text, name=name, participants=2))
    plan = folder.plan()
    for number in (1, 2):
        presenter = SilentPresenter()
        with Session(plan, number, folder.log(number), presenter, simulated=True) as session:
            screen = SimulatedScreen(plan=plan, participant=SimulatedParticipant(), presenter=presenter)
            run(session, screen)
    return folder


def _sweeps(folder: Path) -> None:
    from midair.sweep import PatternSweep, RecordingSweep, SweepTrial, run_sweep

    coarse = Settings().but(grid=ControlGrid(rows=6, columns=6, pitch=11e-3), method="fast")
    pressure = am_stimulus("i", peak=30.0, duration=0.006, rate=1000.0)
    trial = SweepTrial(recording="a", variant="method=fast", pressure=pressure, settings=coarse)
    run_sweep(RecordingSweep(trials=(trial,)), folder / "recordings.sweep", workers=1)
    run_sweep(PatternSweep(count=8, chunk=8, strengths=(0.1,)), folder / "patterns.sweep", workers=1)


def study(path: Path) -> None:
    """Read a study as `midair study analyse` does; analyse one in eight."""
    folder = StudyFolder(path.parent if path.name == "plan.json" else path.parents[1])
    plan = folder.plan()
    sessions = folder.sessions()
    table, thresholds = answers_table(plan, sessions), thresholds_of(plan, sessions)
    data = data_of_answers(table, plan.design.analysis, thresholds=thresholds)
    if len(path.read_bytes()) % 8 == 0:
        analyse(data, draws=10)


def design(path: Path) -> None:
    from midair.files import read_text

    read_design(read_text(path, "the TOML of a study"))


def bids(path: Path) -> None:
    root = next(parent for parent in path.parents if parent.name == "bids")
    _columns(read_bids(root), path)


def answers(path: Path) -> None:
    _columns(read_csv(path), path)


def _columns(table: object, path: Path) -> None:
    data = data_of_columns(
        table, participant="participant", presented="stimulus", answered="answer", rating="right", within=("group",)
    )
    if len(path.read_bytes()) % 8 == 0:
        analyse(data, draws=10)


def sweep(path: Path) -> None:
    """What `midair sweep report` says of a sweep."""
    sweep_report(load_sweep(path.parent))


def state(path: Path) -> None:
    """What a program that runs, or ran, has left for the next one."""
    from midair.devices import stop_playing
    from midair.rig.takes.take import last_subject

    os.environ["MIDAIR_STATE"] = str(path.parent)
    content = path.read_bytes()
    stop_playing(timeout=0.05)
    last_subject()
    path.write_bytes(content)


FOLDER_TARGETS: dict[str, Callable[[Path], object]] = {
    "study/plan.json": study,
    "study/sessions/sub-01.jsonl": study,
    "adaptive/plan.json": study,
    "adaptive/sessions/sub-02.jsonl": study,
    "design.toml": design,
    "bids/sub-01/beh/sub-01_task-small_beh.tsv": bids,
    "answers.csv": answers,
    **{
        f"{name}.sweep/{file}": sweep
        for name in ("patterns", "recordings")
        for file in ("sweep.json", "0000-000000.npz")
    },
    "state/subject.json": state,
    "state/playing-1.json": state,
    "sensor.toml": load_sensor,
    "placement.toml": load_placement,
    "exposure.toml": load_profiles,
    "settings.toml": Settings.load,
}
"""What reads the folder, by the name of the file in it that is damaged."""
