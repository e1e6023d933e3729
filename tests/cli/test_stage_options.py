"""`midair record --stage`: the whole command against a stand-in machine, and what is left when it goes wrong."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.simulators.grbl import GrblSimulator
from tests.waiting import wait_until

from midair.cli import run
from midair.files import load

EXAMPLE = Path(__file__).parents[2] / "docs" / "data" / "stage.toml"
PROGRAM = "import sys; from midair.cli import run; sys.exit(run(sys.argv[1:]))"


@pytest.fixture(autouse=True)
def _stage_file(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    Path("stage.toml").write_text(EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")


@pytest.fixture
def machine():
    made = GrblSimulator()
    yield made
    made.close()


@pytest.fixture
def near():
    """Strokes that begin near the home of the machine, so that the way there is short."""
    text = Path("stage.toml").read_text(encoding="utf-8")
    for far, here in (("[-180.0, -60.0]", "[-60.0, -20.0]"), ("= -22.5", "= -5.0"), ("= -20.0", "= -2.5")):
        assert text.count(far) == 1
        text = text.replace(far, here)
    Path("stage.toml").write_text(text, encoding="utf-8")


def command(machine, *more, stroke="30mm", speed="50mm/s"):
    where = ["--stage", f"grbl:{machine.port}", "--stroke", stroke, "--speed", speed]
    return ["record", "virtual:towel", "out.h5", *where, *more]


def steps(path):
    return {step.stage: step.settings for step in load(path).provenance.steps}


@pytest.mark.long  # It compares a speed with the clock, to 2 %.
def test_a_stroke_ends_where_it_began_and_its_speed_is_in_the_file(machine, capsys, answer):
    assert run(command(machine, stroke="60mm")) == 0
    said = capsys.readouterr()
    assert "it will move: over x -180, y -60 mm at z -20 mm; then 1 x down to z -22.5 mm at 5 mm/s, 60 mm" in said.err
    assert machine.place == pytest.approx([-180, -60, -20])
    assert machine.lost == 0
    found = steps("out.h5")
    assert found["stage"]["speed_m_s"][0] == pytest.approx(0.05, rel=0.02)
    assert found["record"]["stroke_m"] == pytest.approx(0.06)
    assert run(["info", "out.h5", "--all"]) == 0
    shown = capsys.readouterr().out
    assert "stroke " in shown
    assert " stamps" in shown
    stage = next(step for step in answer("info", "out.h5")["steps"] if step["stage"] == "stage")
    assert stage["columns"] == ["time_s", "x_m", "y_m", "z_m", "feed_m_s"]


@pytest.mark.long
@pytest.mark.usefixtures("near")
def test_an_alarm_in_the_middle_keeps_earlier_takes(machine, capsys):
    class Trap(list):
        """Puts a switch in the way once the stroke has begun: the way to its start crosses that place, too."""

        def append(self, move):
            super().append(move)
            if move.speed == pytest.approx(50):
                machine.switch = (0, -30.0)

    machine.moves = Trap()
    assert run(command(machine, "--repeats", "3", stroke="50mm")) == 1
    said = capsys.readouterr().err
    assert "ALARM:1, a limit switch was hit" in said
    assert "frames so far are safe, in out-01.h5" in said
    assert sorted(path.name for path in Path().glob("*.h5")) == ["out-01.h5"]
    found = steps("out-01.h5")
    assert len(found["events"]["strokes"]) == 1
    assert max(row[1] for row in found["stage"]["stamps"]) == pytest.approx(-0.03, abs=0.01)
    assert load("out-01.h5").frames > 500


@pytest.mark.long
@pytest.mark.usefixtures("near")
def test_control_c_holds_the_stage_and_ends_with_130(machine):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *command(machine, stroke="55mm", speed="20mm/s")],
        env=environment,
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    moves = machine.moves
    wait_until(lambda: process.poll() is not None or any(each.speed == pytest.approx(20) for each in moves), 120)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130, said
    assert "midair: stopped;" in said
    assert "the stage stands at x -" in said
    assert machine.state == "Idle"
    assert -60 < machine.place[0] < -5
    assert len(steps("out.h5")["events"]["strokes"]) == 1


@pytest.mark.long
@pytest.mark.usefixtures("near")
def test_a_locked_machine_is_not_moved_but_by_home(capsys):
    machine = GrblSimulator(homed=False)
    try:
        assert run(command(machine)) == 1
        assert "its position is unknown" in capsys.readouterr().err
        assert machine.moves == []
        assert run(command(machine, "--home")) == 0
        assert "homing now; the stage moves" in capsys.readouterr().err
    finally:
        machine.close()


def test_impossible_strokes_are_refused_before_anything_moves(machine, capsys):
    for more, stroke, speed, words in (
        ([], "181mm", "50mm/s", "reaches x 1 mm: expected -240 to 0 mm"),
        ([], "120mm", "300mm/s", "up to 200 mm/s"),
        (["--duration", "1s"], "30mm", "50mm/s", "neither --duration nor --trigger"),
        (["--trigger", "50mV"], "30mm", "50mm/s", "neither --duration nor --trigger"),
        (["--stage-file", "other.toml"], "30mm", "50mm/s", "describes a motion stage"),
    ):
        assert run(command(machine, *more, stroke=stroke, speed=speed)) in (1, 2), words
        assert words in capsys.readouterr().err
        assert (machine.moves, list(Path().glob("*.h5"))) == ([], []), words
