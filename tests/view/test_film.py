import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image
from tests.view.shown import GRID, focus, focus_drive, focus_target, pressure, recording

from midair.errors import InputError, MissingExtraError
from midair.view import (
    Film,
    PalmMaps,
    colour_table,
    film_of_palm,
    show_comparison,
    show_drive,
    show_recording,
    show_target,
    write_gif,
    write_mp4,
)


def colour_of(value):
    return tuple(colour_table("inferno")[round(255 * value)].tolist())


def test_a_gif_has_a_picture_of_every_frame(tmp_path):
    told = []
    film = Film(show_recording(recording(30), part=(0.01, 0.02)), side=64)
    write_gif(film, tmp_path / "film.gif", progress=lambda *done: told.append(done))
    with Image.open(tmp_path / "film.gif") as made:
        assert (made.n_frames, made.info["duration"], made.info["loop"]) == (20, 20, 0)
        assert made.size == film.picture(0).size
    assert told == [(done, 20) for done in range(1, 21)]
    assert (film.slower, film.seconds) == (20, 0.4)


def test_a_cell_has_the_colour_of_its_pressure():
    """The loudest moment of channel 6, which lies in row 1 and column 2 of 4 x 4."""
    values = recording().samples[:, 1, 2]
    film = Film(show_recording(recording()), side=64)
    for frame in (0, 1, int(np.argmax(values))):
        picture = film.picture(frame)
        assert picture.getpixel((14 + 40, 30 + 24)) == colour_of(abs(values[frame]) / np.abs(values).max())
        assert picture.getpixel((14 + 8, 30 + 8)) == colour_of(0)


def test_a_focus_is_at_its_target_whose_map_the_played_one_covers():
    picture = np.asarray(Film(focus(), side=256).picture(2)).astype(int).sum(axis=2)
    wanted, played = picture[30 : 30 + 230, 14 : 14 + 256], picture[30 : 30 + 230, 284 : 284 + 256]
    for each in (wanted, played):
        row, column = np.unravel_index(each.argmax(), each.shape)
        assert abs(row - (9 * 16 + 8)) < 10
        assert abs(column - (6 * 16 + 8)) < 10
    # Points between the control points lie from the first to the last, half a point inside of the squares' edge.
    picture = np.asarray(Film(focus(), side=256).picture(2))
    wanted, played = picture[30:286, 14:270], picture[30:286, 284:540]
    ground = (played == (13, 17, 23)).all(axis=2)
    assert 4 <= ground[:, 128].argmin() <= 12
    assert 4 <= ground[128].argmin() <= 12
    assert not (wanted == (13, 17, 23)).all(axis=2).any()


def test_simulated_films_are_marked_and_every_view_can_be_filmed(subtests):
    for simulated in [True, False]:
        with subtests.test(simulated=simulated):
            shown = focus() if simulated else show_recording(recording())
            picture = Film(shown, side=64).picture(0)
            red = (np.asarray(picture) == (255, 123, 114)).all(axis=2)
            assert red.any() == simulated
    for shown, maps in [
        (show_target(focus_target()), 1),
        (show_drive(focus_drive()), 1),
        (focus(), 2),
        (show_comparison(pressure(), pressure()), 2),
    ]:
        with subtests.test(shown=shown):
            assert Film(shown, side=64).picture(0).width == 14 + maps * 78 + 88


def test_too_long_a_gif_is_refused_before_the_work(tmp_path):
    with pytest.raises(InputError, match="at most 2000 frames in a GIF, got 2001"):
        write_gif(Film(show_recording(recording(2001))), tmp_path / "film.gif")


@pytest.mark.skipif(shutil.which("ffprobe") is None, reason="no ffmpeg here")
def test_an_mp4_has_a_picture_of_every_frame(tmp_path):
    film = Film(show_recording(recording(12)), side=64)
    write_mp4(film, tmp_path / "film.part")
    asked = ["-count_frames", "-show_entries", "stream=nb_read_frames,width,height,r_frame_rate", "-of", "csv=p=0"]
    said = subprocess.run(["ffprobe", "-v", "error", *asked, tmp_path / "film.part"], capture_output=True, text=True)
    width, height = film.picture(0).size
    assert said.stdout.split() == [f"{width},{height},50/1,12"]


def test_without_ffmpeg_or_with_its_error_an_mp4_is_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MissingExtraError, match=r"needs ffmpeg, .* save a .gif"):
        write_mp4(Film(show_recording(recording(3))), tmp_path / "film.mp4")
    false = tmp_path / "ffmpeg"
    false.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n")
    false.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    with pytest.raises(InputError, match="no such codec"):
        write_mp4(Film(show_recording(recording(3))), tmp_path / "film.mp4")


def lines(picture, top):
    """Length in pixels of the white line below the map, whose side is `top` - 30."""
    row = np.asarray(picture)[top + 12, 14 : 14 + top - 30]
    return int((row == 255).all(axis=1).argmin())


def test_scale_bar_has_the_stated_length():
    """10 mm of the sensor's 44; of the field's 16 points 3.67 mm apart, 10 of 58.7."""
    assert lines(Film(show_recording(recording()), side=256).picture(0), 286) == pytest.approx(256 * 10 / 44, abs=2)
    assert lines(Film(focus(), side=256).picture(0), 286) == pytest.approx(256 * 10 / (1e3 * 16 * GRID.pitch), abs=2)


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


def test_a_palm_is_red_and_blue_on_a_root_scale_around_the_square_of_the_sensor():
    film = film_of_palm([maps()], rate=1000.0, side=80)
    assert (len(film), film.slower) == (3, 20)
    assert colour(film.picture(1), 1, 2) == shade(1.0)
    assert colour(film.picture(1), 2, 5) == shade(0.0)
    # A quarter of the strongest is half way to it.
    assert colour(film.picture(2), 1, 2) == shade(0.75)
    assert colour(film.picture(0), 2, 2) == shade(0.5)
    picture = film_of_palm([maps()], rate=1000.0, side=80).picture(0)
    ground = picture.getpixel((2, 2))
    assert colour(picture, 0, 0) == ground
    assert colour(picture, -1, 4) == colour(picture, 4, 4) == ground
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
