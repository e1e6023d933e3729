"""Two hundred kills of each of new, run, analyse and export: no loss and no partial file."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.drives import save_drive

from midair.study.drives import check_digests
from midair.study.folder import StudyFolder, template_text
from midair.study.session.event_log import read_events
from midair.study.tables import read_csv

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="forks")
KILLS = [pytest.param(2, marks=pytest.mark.long), pytest.param(60, marks=pytest.mark.slow)]


@pytest.fixture(scope="module")
def killer():
    program = [sys.executable, str(Path(__file__).parent / "forks.py")]
    with subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout.readline() == "ready\n"

        def run(*words, after=None):
            running.stdin.write(json.dumps({"words": [str(word) for word in words], "after": after}) + "\n")
            running.stdin.flush()
            return json.loads(running.stdout.readline())

        yield run
        running.stdin.close()


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    for source in {f"{thing}-{way}.drive.h5" for thing in ("brush", "sponge", "towel") for way in ("plain", "grooved")}:
        save_drive(folder / source, level=0.01, frames=5)
    text = template_text("paper").replace("repetitions = 4", "repetitions = 2")
    (folder / "plan.toml").write_text(text.replace("participants = 10", "participants = 2"), encoding="utf-8")
    return folder / "plan.toml"


@pytest.fixture(scope="module")
def finished(killer, plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished") / "s"
    assert killer("study", "new", folder, "--source", plan)["status"] == 0
    assert killer("study", "run", folder, "--simulate")["status"] == 0
    return folder


def killed(killer, kills, words, look):
    """Kill a command at random times, repeatedly; `look` returns the state afterwards."""
    rng = np.random.default_rng(kills)
    lasts = killer(*words(-1))["lasted"]
    look(-1)
    hits = runs = 0
    while hits < kills:
        ended = killer(*words(runs), after=float(rng.uniform(0, 1.05 * lasts)))
        assert ended["status"] in (0, -9)
        hits += ended["status"] == -9
        look(runs)
        runs += 1
    assert killer(*words(runs))["status"] == 0
    look(runs)


@pytest.mark.parametrize("kills", KILLS)
def test_a_study_is_complete_or_absent(killer, plan, tmp_path, kills):
    whole = []

    def look(number):
        folder = StudyFolder(tmp_path / f"s{number}")
        whole.append(folder.path.exists())
        if whole[-1]:
            found = folder.plan()
            check_digests(folder.path, found.drives, found.design.stimuli)
            assert len(found.drives) == 6
        assert not [name for name in os.listdir(tmp_path) if not name.startswith((".midair-", "s"))]

    killed(killer, kills, lambda number: ("study", "new", tmp_path / f"s{number}", "--source", plan), look)
    assert whole[0]
    assert whole[-1]


@pytest.mark.parametrize("kills", KILLS)
def test_no_answer_is_lost(killer, plan, tmp_path, kills):
    known = {}

    def look(number):
        folder = StudyFolder(tmp_path / f"s{max(number, 0) // 5}")
        if folder.log(1).exists():
            answers = [event for event in read_events(folder.log(1)) if event["event"] == "answer"]
            (session,) = [one for one in folder.sessions() if one.trials[0].participant == 1]
            stored = {key: given.answer for key, given in session.answers.items()}
            assert len(answers) == len(stored), "asked twice"
            before = known.get(folder.path, {})
            assert before.items() <= stored.items(), "an answer was lost"
            known[folder.path] = stored

    def words(number):
        folder = tmp_path / f"s{max(number, 0) // 5}"
        if not folder.exists():
            assert killer("study", "new", folder, "--source", plan)["status"] == 0
        return ("study", "run", folder, "--simulate", "--participant", 1)

    killed(killer, kills, words, look)
    assert any(known.values())


@pytest.mark.long
@pytest.mark.parametrize("kills", KILLS)
def test_a_report_is_complete(killer, finished, kills):
    report = finished / "report.html"

    def look(_number):
        assert report.read_text(encoding="utf-8").rstrip().endswith("</html>")
        assert all(json.loads(line)["kind"] for line in (finished / "made.jsonl").read_text().splitlines())

    killed(killer, kills, lambda _: ("study", "analyse", finished, "--draws", 20), look)
    assert not [name for name in os.listdir(finished) if name.endswith(".html") and name != "report.html"]


@pytest.mark.long
@pytest.mark.parametrize("kills", KILLS)
def test_an_export_is_complete_or_absent(killer, finished, tmp_path, kills):
    for kind in ("bids", "csv"):
        first = []

        def look(number, kind=kind, first=first):
            there = tmp_path / f"{kind}{number}"
            if there.exists():
                files = {path.relative_to(there): path.read_bytes() for path in there.rglob("*") if path.is_file()}
                first.append(files or there.read_bytes())
                assert first[-1] == first[0]

        def words(number, kind=kind):
            return "study", "export", finished, tmp_path / f"{kind}{number}", "--format", kind

        killed(killer, kills, words, look)
    assert len(read_csv(tmp_path / "csv-1")) == 2 * (6 + 2 * (3 + 6) * 4)
