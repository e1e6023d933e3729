"""Poses of a palm in CSV."""

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import load_palm_path, save_palm_path
from midair.model import PalmPath

HEAD = "time,x,y,z,nx,ny,nz,dx,dy,dz,confidence\n"


def test_poses_are_read_as_they_were_written(tmp_path):
    rng = np.random.default_rng(1)
    palm = PalmPath(
        time=np.arange(5) / 110,
        centre=rng.random((5, 3)),
        normal=np.tile([0, 0, -1.0], (5, 1)),
        fingers=np.tile([0, 1.0, 0], (5, 1)),
        confidence=rng.random(5),
    )
    save_palm_path(palm, tmp_path / "hand.csv")
    read = load_palm_path(tmp_path / "hand.csv")
    for name in ("time", "centre", "normal", "fingers", "confidence"):
        np.testing.assert_array_equal(getattr(read, name), getattr(palm, name))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time,x\n0,1\n", "expected the columns time,x,y,z"),
        (HEAD + "0,0,0,.2,0,0,-2,0,1,0,1\n", "vectors of length 1"),
        (HEAD + "0,0,0,.2,0,0,-1,0,1,0,1\n" * 2, "increasing times"),
        (HEAD + "0,0,0,.2,0,0,-1,0,1,0,7\n", "confidence"),
    ],
)
def test_a_file_of_other_content_is_refused(tmp_path, text, told):
    (tmp_path / "hand.csv").write_text(text)
    with pytest.raises(BrokenFileError, match=told):
        load_palm_path(tmp_path / "hand.csv")
