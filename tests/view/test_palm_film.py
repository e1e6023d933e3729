import numpy as np
import pytest
from PIL import Image

from midair.view import PalmMaps, colour_table, film_of_palm, write_gif

SQUARE = (10e-3, 5e-3)


def maps(**more):
    """A palm of 8 x 4 points, 5 mm apart, with one positive and one negative point; one has no skin."""
    pressure = np.zeros((3, 4, 8))
    pressure[1, 1, 2], pressure[1, 2, 5], pressure[2, 1, 2] = 4.0, -4.0, 1.0
    pressure[:, 0, 0] = np.nan
    return PalmMaps(maps={"played": pressure}, unit="Pa", pitch=5e-3, square=SQUARE, **more)


def colour(picture, row, column):
    """Pixel of a point: the map is centred in 8 x 8 points of 10 pixels."""
    return picture.getpixel((14 + 10 * column + 5, 30 + 10 * (row + 2) + 5))


def shade(part):
    return tuple(colour_table("RdBu_r")[round(255 * part)].tolist())


def test_positive_is_red_and_negative_is_blue_on_a_root_scale():
    film = film_of_palm([maps()], rate=1000.0, side=80)
    assert (len(film), film.slower) == (3, 20)
    assert colour(film.picture(1), 1, 2) == shade(1.0)
    assert colour(film.picture(1), 2, 5) == shade(0.0)
    # A quarter of the strongest is half way to it.
    assert colour(film.picture(2), 1, 2) == shade(0.75)
    assert colour(film.picture(0), 2, 2) == shade(0.5)


def test_points_without_skin_are_background_and_the_aspect_ratio_is_kept():
    picture = film_of_palm([maps()], rate=1000.0, side=80).picture(0)
    ground = picture.getpixel((2, 2))
    assert colour(picture, 0, 0) == ground
    assert colour(picture, -1, 4) == colour(picture, 4, 4) == ground


def test_square_of_the_sensor_is_at_its_position():
    picture = np.asarray(film_of_palm([maps()], rate=1000.0, side=80).picture(0))[30:110, 14:94]
    rows, columns = np.nonzero((picture == (110, 115, 120)).all(axis=2))
    # 80 pixels are 40 mm: 20 pixels and 10 on either side of the middle.
    assert (columns.min(), columns.max()) == pytest.approx((20, 60), abs=1)
    assert (rows.min(), rows.max()) == pytest.approx((30, 50), abs=1)


def test_a_gif_keeps_both_ends_of_the_colours(tmp_path):
    write_gif(film_of_palm([maps()], rate=1000.0, side=80), tmp_path / "palm.gif")
    with Image.open(tmp_path / "palm.gif") as made:
        made.seek(1)
        picture = made.convert("RGB")
    for row, column, part in ((1, 2, 1.0), (2, 5, 0.0)):
        assert np.abs(np.subtract(colour(picture, row, column), shade(part))).max() < 12
