"""`midair draw`, and every command that takes the drive that it writes."""

from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.palms import palm_path

from midair.cli import run
from midair.errors import InputError
from midair.files import load_solution, load_target, save_palm_path
from midair.patterns import load_pattern
from midair.physics import transfer_matrix
from midair.settings import Settings

EXAMPLES = Path(__file__).parents[2] / "patterns" / "adaptics"
pytestmark = pytest.mark.usefixtures("own_state")
CIRCLE = """
name = "circle"
rate_hz = 4000
duration_s = 0.25
[[spot]]
shape = { name = "circle", radius_mm = 12 }
draw_hz = 60
pressure_pa = 40
am = { frequency_hz = 30, depth = 0.5 }
"""


@pytest.fixture
def drawn(answer):
    Path("circle.toml").write_text(CIRCLE, encoding="utf-8")
    return answer("draw", "circle.toml", "circle.drive.h5", "--wanted", "circle.h5", "--temperature", "22C")


@pytest.mark.long
def test_a_drawn_drive_states_how_it_was_made(drawn):
    assert (drawn["frames"], drawn["rate_hz"], drawn["foci"], drawn["pressure_pa"]) == (1000, 4000.0, 1, 40.0)
    assert 0.02 < drawn["reach_used"] < 0.04
    drive = load_solution("circle.drive.h5").drive
    assert drive.provenance.source == "circle.toml"
    assert drive.provenance.last("draw")["pattern"] == CIRCLE
    assert Settings.of(drive.provenance).target.rate == 4000
    target = load_target("circle.drive.h5")
    field = np.abs(drive.q @ transfer_matrix(target.grid, drive.array, acoustics=drive.acoustics).T)
    assert np.abs(field - target.amplitude).max() < 0.01 * target.amplitude.max()  # phases of 8 bits


@pytest.mark.long
def test_a_recorded_signal_modulates_a_moving_spot(answer):
    time = np.arange(4000) / 8000
    soundfile.write("hum.wav", 0.25 * np.sin(2 * np.pi * 100 * time), 8000)
    table = 'signal = { file = "hum.wav", depth = 0.5 }'
    Path("hum.toml").write_text(f"[[spot]]\npressure_pa = 40\nshape = {{ name = 'line', length_mm = 40 }}\n{table}\n")
    answer("draw", "hum.toml", "hum.drive.h5", "--duration", "1s")
    pressure = load_solution("hum.drive.h5").drive.level ** 2
    pressure = 40 * pressure / pressure.max()
    line = 2 / len(pressure) * np.abs(np.fft.rfft(pressure))[100]
    assert line == pytest.approx(10, rel=0.03)
    assert pressure.min() == pytest.approx(20, rel=0.05)
    # The same through another folder; and with a channel that is not there.
    Path("sub").mkdir()
    Path("sub/hum.toml").write_text(Path("hum.toml").read_text().replace("hum.wav", "../hum.wav"))
    answer("draw", "sub/hum.toml", "other.drive.h5", "--duration", "1s")
    Path("wrong.toml").write_text(Path("hum.toml").read_text().replace("depth = 0.5", "channel = 3"))
    with pytest.raises(InputError, match=r"signal\.channel: expected 0 to 0 of hum\.wav, got 3"):
        load_pattern("wrong.toml").foci(1.0)


@pytest.mark.long
def test_it_plays_is_shown_and_checked_as_any_drive(drawn, capsys, answer):
    assert run(["play", "circle.drive.h5"]) == 0
    assert "played 0.25 s on the virtual array" in capsys.readouterr().out
    figures = answer("compare", "circle.h5", "circle.rerecorded.h5")["figures"]
    assert figures["correlation"]["value"] > 0.99
    assert figures["dominant frequency, reproduced"]["value"] == 60
    assert figures["signal to distortion, touched cells"]["value"] > 20
    assert answer("exposure", "circle.drive.h5")["palm_pressure_pa"] == pytest.approx(40, rel=0.1)
    assert run(["show", "circle.drive.h5", "--save", "circle.html", "--no-browser"]) == 0
    assert run(["info", "circle.drive.h5"]) == 0
    assert "circle.toml" in capsys.readouterr().out


@pytest.mark.long
def test_a_drawn_drive_is_compared_and_follows_a_palm(drawn, answer, capsys):
    assert answer("compare", "circle.h5", "circle.drive.h5")["figures"]["correlation"]["value"] > 0.99
    time = np.linspace(0, 1, 101)
    save_palm_path(palm_path(time, np.column_stack([0.01 * time, 0 * time, 0.2 + 0 * time])), "hand.csv")
    assert run(["play", "circle.drive.h5", "--follow", "replay:hand.csv", "--palm-path", "hand.csv"]) == 0
    assert "the palm is followed" in capsys.readouterr().err
    assert answer("compare", "circle.h5", "circle.rerecorded.h5")["figures"]["correlation"]["value"] > 0.9


@pytest.mark.long
def test_a_pattern_is_played_at_once(capsys):
    Path("circle.toml").write_text(CIRCLE.replace("0.25", "0.02"), encoding="utf-8")
    assert run(["play", "circle.toml"]) == 0
    assert "circle.rerecorded.h5" in capsys.readouterr().out
    assert {path.name for path in Path().iterdir()} >= {"circle.toml", "circle.rerecorded.h5"}
    assert not Path("circle.drive.h5").exists()
    Path("loop.toml").write_text("[[spot]]", encoding="utf-8")
    assert run(["play", "loop.toml"]) == 1
    assert "the pattern is a loop" in capsys.readouterr().err


@pytest.mark.long
def test_a_pattern_of_the_adaptics_designer_is_drawn_with_its_parameters(answer):
    rain = EXAMPLES / "Rain.adaptics"
    chosen = ["--parameter", "droplet_strength=1", "--parameter", "rainfall_amount=0.5", "--duration", "0.05s"]
    drawn = answer("draw", str(rain), "rain.drive.h5", *chosen, "--pressure", "80Pa")
    assert (drawn["frames"], drawn["pressure_pa"]) == (200, 80.0)
    made = load_solution("rain.drive.h5").drive.provenance.last("draw")
    assert (made["parameter droplet_strength"], made["parameter rainfall_amount"]) == (1.0, 0.5)
    assert made["pattern"] == rain.read_text(encoding="utf-8")


MISTAKES = {
    "spot 1: shape: expected one of points, circle,": '[[spot]]\nshape = "star"',
    "spot: expected one table [[spot]] or more": "duration_s = 1.0",
    "spot: expected one table": "spot = 3",
    "duration: expected a time, since the pattern is a loop": "[[spot]]",
    "spot 1: pressure_pa: expected 0 to 10000 Pa, got nan Pa": "[[spot]]\npressure_pa = nan",
    "spot 1: radius: expected one of": "[[spot]]\nradius = 3",
    "expected at most 1511 Pa at (0, 0, 200) mm, all that": "duration_s = 1.0\n[[spot]]\npressure_pa = 2000.0",
    "45 degrees beside it, got (800, 0, 200) mm": "duration_s = 1.0\n[[spot]]\ncentre_mm = [800, 0]",
    "rate_hz: expected 1 to 8000 Hz, got 9000 Hz": "rate_hz = 9000\n[[spot]]",
    "frame rate: expected 40000 Hz over a whole number": "duration_s = 1.0\nrate_hz = 3000\n[[spot]]",
    "TB of free memory": "duration_s = 1e5\nrate_hz = 8000\n" + 32 * "[[spot]]\n",
    "Pa in 2 foci at once, all that": "duration_s = 1.0\n"
    + "".join(f"[[spot]]\ncentre_mm = [{x}, 0]\npressure_pa = 1000.0\n" for x in (0, 20)),
    "am.frequency_hz: expected at most 2000 Hz": "[[spot]]\nam = { frequency_hz = 2500.0 }",
    "expected a pattern in TOML, got": "a circle, please",
    "size: expected 5 to 20, got 30": "[parameters]\nsize = { default = 30, min = 5, max = 20 }\n[[spot]]",
}


def test_a_pattern_that_cannot_be_drawn_is_refused_in_one_line(one_line):
    for said, text in MISTAKES.items():
        Path("bad.toml").write_text(text, encoding="utf-8")
        assert run(["draw", "bad.toml"]) == 1, said
        assert said in one_line()
        assert {path.name for path in Path().iterdir()} - {"state"} == {"bad.toml"}, said
