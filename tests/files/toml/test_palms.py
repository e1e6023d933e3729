import numpy as np
import pytest

from midair.errors import BrokenFileError, MissingFileError
from midair.files import load_palm
from midair.model import Palm


def written(tmp_path, text):
    path = tmp_path / "left.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_disc_and_corners(tmp_path):
    disc = load_palm(written(tmp_path, "disc_mm = 60\npitch_mm = 2"))
    np.testing.assert_array_equal(disc.inside, Palm.disc(60e-3, pitch=2e-3).inside)
    assert (disc.name, disc.pitch) == ("left", pytest.approx(2e-3))
    square = load_palm(written(tmp_path, 'name = "a"\noutline_mm = [[-30, -30], [30, -30], [30, 30], [-30, 30]]'))
    assert square.name == "a"
    assert square.inside[1:-1, 1:-1].all()


def test_dark_pixels_are_skin(tmp_path):
    from matplotlib.image import imsave

    picture = np.ones((50, 100, 4))
    picture[10:40, 20:60, :3] = 0.1
    picture[:, 90:, 3] = 0.0
    imsave(tmp_path / "hand.png", picture)
    palm = load_palm(written(tmp_path, 'picture = "hand.png"\nwidth_mm = 100\npitch_mm = 1'))
    x, y = np.meshgrid(palm.grid(0.2).x, palm.grid(0.2).y)
    # One pixel is a millimetre: dark from x = -30 to 10, y = -15 to 15 mm.
    drawn = (x >= -30e-3) & (x < 10e-3 - 1e-9) & (y >= -15e-3) & (y < 15e-3 - 1e-9)
    np.testing.assert_array_equal(palm.inside, drawn)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "one of disc_mm, outline_mm and picture, got 0"),
        ("disc_mm = 80\npicture = 'x.png'", "got 2"),
        ("disc = 80", "disc"),
        ("disc_mm = -1", "diameter of the palm"),
        ("outline_mm = [[0, 0], [1, 1]]", "three corners"),
        ("picture = 'x.png'", "width_mm beside picture"),
        ("disc_mm = 'wide'", "disc_mm"),
    ],
)
def test_wrong_files_are_refused(tmp_path, text, word):
    with pytest.raises(BrokenFileError, match=word):
        load_palm(written(tmp_path, text))


def test_invalid_pictures_are_refused(tmp_path):
    path = written(tmp_path, 'picture = "hand.png"\nwidth_mm = 100')
    with pytest.raises(MissingFileError, match="found no file"):
        load_palm(path)
    (tmp_path / "hand.png").write_bytes(b"GIF89a" + bytes(40))
    with pytest.raises(BrokenFileError, match="expected a PNG"):
        load_palm(path)
    (tmp_path / "hand.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(8) + b"\x00\x01\x00\x00" * 2)
    with pytest.raises(BrokenFileError, match="65536 x 65536"):
        load_palm(path)
