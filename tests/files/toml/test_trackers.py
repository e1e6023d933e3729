"""Placement of a tracker in TOML."""

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import load_tracker, save_tracker


def test_a_placement_is_read_and_written(tmp_path):
    path = tmp_path / "leap.toml"
    path.write_text("rotation_deg = [0, 0, 90]\noffset_mm = [0, -120, 15]\n")
    placement = load_tracker(path)
    np.testing.assert_allclose(placement.points(np.array([0.1, 0, 0.2])), [0, -0.02, 0.215], atol=1e-12)
    save_tracker(placement, tmp_path / "again.toml")
    np.testing.assert_allclose(load_tracker(tmp_path / "again.toml").rotation, placement.rotation, atol=1e-7)


@pytest.mark.parametrize("text", ["turn = 1", "offset_mm = [1, 2]", "uncertainty_mm = -1"])
def test_wrong_keys_and_values_are_refused(tmp_path, text):
    (tmp_path / "leap.toml").write_text(text)
    with pytest.raises(BrokenFileError, match=r"leap\.toml"):
        load_tracker(tmp_path / "leap.toml")
