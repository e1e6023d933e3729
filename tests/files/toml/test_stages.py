from pathlib import Path

import pytest

from midair.errors import BrokenFileError, MissingFileError
from midair.files.toml.stages import load_stage

EXAMPLE = Path(__file__).parents[3] / "docs" / "data" / "stage.toml"


def test_the_example_is_read_in_metres():
    setup = load_stage(EXAMPLE)
    assert setup.heading == "+x"
    assert setup.start == pytest.approx((-0.18, -0.06))
    assert (setup.contact, setup.clear, setup.approach, setup.back) == pytest.approx((-0.0225, -0.02, 0.005, 0.1))
    assert setup.travel[2] == pytest.approx((-0.06, 0.0))
    assert setup.homing == "switches"
    setup.check(0.12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("contact_mm", "contact", "got contact$"),
        ("contact_mm = -22.5", "", "contact_mm is missing"),
        ("contact_mm = -22.5", 'contact_mm = "deep"', "contact_mm: expected a number"),
        ("contact_mm = -22.5", "contact_mm = true", "contact_mm: expected a number"),
        ("contact_mm = -22.5", "contact_mm = nan", "contact_mm: expected a number"),
        ("contact_mm = -22.5", "contact_mm = -10", "clear_mm: expected a height above contact_mm"),
        ('"+x"', '"x"', "heading: expected .x or -x or .y or -y"),
        ("[-180.0, -60.0]", "[-180.0]", "start_mm: expected two numbers"),
        ("z_mm", "w_mm", "got travel.w_mm"),
        ("[-60.0, 0.0]", "[0.0, -60.0]", "travel.z_mm: expected the smaller value first"),
        ("[travel]", "[[travel]]", "travel: expected a table"),
        ('heading = "+x"', 'heading = "+x"\nhoming = "never"', "homing: expected switches or by hand"),
        ('heading = "+x"', "heading = +x", "expected a TOML file"),
    ],
)
def test_invalid_values_are_named(tmp_path, old, new, words):
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "stage.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(BrokenFileError, match=words):
        load_stage(path)


def test_a_missing_file_is_described(tmp_path):
    with pytest.raises(MissingFileError, match="describes a motion stage"):
        load_stage(tmp_path / "stage.toml")
