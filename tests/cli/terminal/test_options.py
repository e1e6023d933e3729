import pytest

from midair.cli import run
from midair.cli.terminal.options import SolveOptions
from midair.files import load_solution
from midair.settings import Settings
from midair.targets import Circle


def stages(path):
    return {step.stage: step.settings for step in load_solution(path).drive.provenance.steps}


def test_the_options_that_nobody_gave_are_the_paper_s():
    assert SolveOptions().settings() == Settings()


def test_a_radius_makes_a_circle():
    assert SolveOptions(circle=2e-3, circle_rate=4.0).settings().target.circle == Circle(radius=2e-3, frequency=4.0)


@pytest.fixture
def stroke(tmp_path):
    assert run(["record", "virtual:am-i", str(tmp_path / "am.h5"), "--duration", "0.1s"]) == 0
    return tmp_path / "am.h5"


def test_the_command_line_of_fidelity(stroke, tmp_path):
    """Rate, mapping, decoupling, pre-compensation and motion reach the drive that is written."""
    drive = tmp_path / "am.drive.h5"
    words = "--rate 4kHz --mapping slow-bias --interpolate pressure --decouple --precompensate --circle 3mm"
    small = "--points 6 --pitch 11mm --method fast --iterations 2 2 --start-at 20ms --duration 10ms"
    assert run(["solve", str(stroke), str(drive), *words.split(), *small.split()]) == 0
    made = stages(drive)
    assert load_solution(drive).drive.rate == 4000
    assert load_solution(drive).drive.frames == 40
    assert list(made)[-4:] == ["decouple", "prepare", "precompensate sound", "solve"]
    assert made["prepare"]["mapping"] == "slow-bias"
    assert made["prepare"]["motion"] == "circle of 3 mm at 5 Hz, not validated on people"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--rate 3kHz", "40000 Hz over a whole number"),
        ("--mapping full-wave", "half-wave, constant-offset, slow-bias"),
        ("--circle 3mm --circle-rate 30Hz", "below 20 Hz, got 30 Hz"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(stroke, tmp_path, words, said, capsys):
    drive = tmp_path / "no.drive.h5"
    assert run(["solve", str(stroke), str(drive), *words.split()]) == 1
    assert said in capsys.readouterr().err
    assert not drive.exists()
