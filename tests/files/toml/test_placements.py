import numpy as np
import pytest

from midair.errors import BrokenFileError, InputError, MissingFileError
from midair.files import load_placement
from midair.model import Placement

TURNED = """
name = "corner"
[[unit]]
position_mm = [0, 0, 0]
[[unit]]
position_mm = [192.0, 0.0, 50]
rotation_deg = [0, -30, 90]
"""


def test_from_a_file(tmp_path):
    path = tmp_path / "corner.toml"
    path.write_text(TURNED, encoding="utf-8")
    placement = load_placement(path)
    assert (placement.name, placement.units) == ("corner", 2)
    np.testing.assert_allclose(placement.position[1], [0.192, 0, 0.05])
    np.testing.assert_allclose(np.degrees(placement.rotation[1]), [0, -30, 90])
    np.testing.assert_allclose(placement.array().position.mean(axis=0), 0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "no unit"),
        ("unit = 3", "no unit"),
        ("[[unit]]\nposition_mm = [0, 0]", "three numbers"),
        ("[[unit]]\nposition_mm = [0, 0, true]", "three numbers"),
        ("[[unit]]\nposition = [0, 0, 0]", "position_mm"),
        ("[[unit]]\nposition_mm = [0, 0, 0]\nrotation_deg = 3", "three numbers"),
        ("columns = 3\n[[unit]]\nposition_mm = [0, 0, 0]", "columns"),
        ("[[unit", "TOML"),
    ],
)
def test_wrong_files_are_refused(tmp_path, text, word):
    (tmp_path / "x.toml").write_text(text, encoding="utf-8")
    with pytest.raises(BrokenFileError, match=word):
        load_placement(tmp_path / "x.toml")


def test_invalid_numbers_and_missing_files(tmp_path):
    (tmp_path / "x.toml").write_text("[[unit]]\nposition_mm = [0, 0, nan]", encoding="utf-8")
    with pytest.raises(InputError, match="unit position"):
        load_placement(tmp_path / "x.toml")
    with pytest.raises(MissingFileError, match=r"y\.toml"):
        load_placement(tmp_path / "y.toml")
    with pytest.raises(InputError, match="0 x 1"):
        Placement.grid(columns=0, rows=1)
