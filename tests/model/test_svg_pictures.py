import re
from xml.etree import ElementTree

import numpy as np
import pytest

from midair.model.svg_pictures import PictureStyle, curve, dots, framed, heat_map, path_of, sparklines, thinned

SVG = "{http://www.w3.org/2000/svg}"
ROUND = PictureStyle(width=200, left=50, right=50)


def paths(picture):
    return list(ElementTree.fromstring(picture).iter(SVG + "path"))


def words(picture):
    return [text.text for text in ElementTree.fromstring(picture).iter(SVG + "text")]


def test_a_path_begins_anew_after_nan_and_a_lone_point_is_a_dot():
    assert path_of(np.arange(5.0), np.array([1.0, 2, np.nan, 4, np.nan])) == "M0 1 1 2M3 4 3 4"
    assert path_of(np.arange(2.0), np.full(2, np.nan)) == ""


def test_the_ends_and_extremes_of_a_long_trace_are_kept():
    values = np.sin(np.arange(10_000.0))
    values[[3333, 7777]] = -9, 9
    at = thinned(np.arange(10_000.0), values, 40)
    assert len(at) <= 42
    assert {0, 3333, 7777, 9999} <= set(at)
    assert (np.diff(at) > 0).all()


def test_a_short_trace_is_drawn_as_it_is():
    assert thinned(np.arange(5.0), np.zeros(5), 5).tolist() == [0, 1, 2, 3, 4]


def test_a_stretch_of_nan_stays_a_gap():
    values = np.ones(1000)
    values[400:600] = np.nan
    at = thinned(np.arange(1000.0), values, 20)
    assert np.isnan(values[at]).any()
    assert np.isfinite(values[at]).any()


def test_traces_lie_at_their_cells_on_one_scale():
    values = np.zeros((2, 1, 2))
    values[:, 0, 0], values[:, 0, 1] = [-1.0, 1], [0.0, 0]
    picture = sparklines(values, duration=0.5, unit="V", style=ROUND)
    # Two cells of 100 x 90 px with 3 px around the trace: 0 is half-way up.
    assert paths(picture)[0].get("d") == "M3 87 97 3M103 45 197 45"
    assert words(picture) == ["each: 0 to 0.5 s, -1 to 1 V"]


def test_one_frame_is_a_line_in_the_middle():
    picture = sparklines(np.full((1, 1, 1), 7.0), duration=0.1, unit="Pa", style=ROUND)
    assert paths(picture)[0].get("d") == "M3 45 197 45"
    assert words(picture) == ["each: 0 to 0.1 s, 7 Pa"]


def test_only_some_of_many_channels_are_drawn_and_the_picture_states_it():
    picture = sparklines(np.zeros((5, 12, 20)), duration=1.0, unit="V")
    assert paths(picture)[0].get("d").count("M") == 6 * 7
    assert words(picture)[0].endswith("42 of 240 channels")


def test_a_map_has_row_0_at_the_top_and_the_highest_value_in_the_last_colour():
    picture = heat_map(
        np.array([[0.0, 8], [4, 0]]), np.array([-1e-3, 1e-3]), np.array([-2e-3, 2e-3]), unit="Pa", style=ROUND
    )
    squares = {path.get("fill"): path.get("d") for path in paths(picture)[:3]}
    assert squares == {
        ROUND.quantity[0]: "M0 0h1v1h-1zM1 1h1v1h-1z",
        ROUND.quantity[8]: "M0 1h1v1h-1z",
        ROUND.quantity[15]: "M1 0h1v1h-1z",
    }
    assert 'translate(50 4) scale(50.000)"' in picture
    assert words(picture) == ["-2", "2", "-1", "1 mm", "8 Pa", "0 Pa"]


def test_a_large_map_keeps_its_highest_point():
    values = np.zeros((100, 100))
    values[57, 31] = 5
    picture = heat_map(values, np.arange(100), np.arange(100), unit="Pa")
    assert f'fill="{ROUND.quantity[15]}" d="M7 14h1v1h-1z"' in picture  # 4 x 4 points a square.


def test_dots_are_to_scale_and_y_grows_downwards():
    place = np.array([[-0.05, 0.0], [0.05, 0.0], [0.0, 0.05]])
    picture = dots(place, np.array([0, 5, -1]), bar=("2π rad", "0"), style=ROUND)
    drawn = {path.get("stroke"): path.get("d") for path in paths(picture)[:3]}
    # 100 mm over 100 px: 1 px a mm.
    assert drawn == {ROUND.phase[0]: "M0 0h0", ROUND.phase[5]: "M100 0h0", "currentColor": "M50 50h0"}
    assert words(picture) == ["0", "50", "-50", "50 mm", "2π rad", "0"]


def test_a_phase_has_its_colour_of_sixteen():
    assert len(ROUND.phase) == len(ROUND.quantity) == len(set(ROUND.phase)) == 16


@pytest.mark.parametrize("shape", [(5000, 1), (70, 70), (2500, 2)])
def test_of_many_dots_so_many_are_drawn_that_the_picture_stays_small(shape):
    place = np.stack(np.meshgrid(*map(np.arange, shape)), axis=-1).reshape(-1, 2) * 0.01
    picture = dots(place, np.arange(len(place)) % 16)
    assert 300 < picture.count("h0") < 1600
    assert len(picture) < 20_000


def test_a_curve_begins_at_zero_and_ends_at_its_highest_value():
    picture = curve(
        np.array([0.0, 1, 2]), np.array([0.0, 10, 5]), x_label="s", y_unit="%", style=PictureStyle(width=254)
    )
    # 200 px wide, 100 px high, foot of the axis at 118 px.
    assert paths(picture)[-1].get("d") == "M44 118 144 18 244 68"
    assert words(picture) == ["10 %", "0", "0", "2 s"]


def test_a_logarithmic_axis_has_its_decades_at_equal_distances():
    style = PictureStyle(width=354)
    picture = curve(10.0 ** np.arange(4), np.ones(4), x_label="Hz", y_unit="V/Pa", logarithmic=True, style=style)
    assert paths(picture)[-1].get("d") == "M44 18 144 18 244 18 344 18"
    assert words(picture) == ["1 V/Pa", "0", "1", "1000 Hz", "10", "100"]


def test_a_range_goes_there_above_and_back_below():
    x, y = np.array([0.0, 1]), np.array([5.0, 5])
    picture = curve(x, y, x_label="", y_unit="", around=(y - 5, y + 5), style=PictureStyle(width=154))
    assert paths(picture)[1].get("d") == "M44 118 144 118 144 18 44 18z"


def test_a_curve_of_nothing_is_an_empty_axis():
    picture = curve(np.arange(3.0), np.full(3, np.nan), x_label="frame", y_unit="%")
    assert paths(picture)[-1].get("d") == ""
    assert words(picture)[0] == "0 %"


def test_a_frame_escapes_its_caption():
    class Noun:
        def __repr__(self):
            return "<Noun '<b>'>"

    text = framed(Noun(), "<svg/>", "a < b", simulated=True)
    caption = ElementTree.fromstring(text).find("figcaption")
    assert caption.text == "a < b, SIMULATED"
    assert caption.find("span").text == "<Noun '<b>'>"


def test_lines_and_labels_have_the_text_colour_of_the_page():
    picture = curve(np.arange(3.0), np.arange(3.0), x_label="s", y_unit="Pa")
    assert not re.search(r"#[0-9a-f]{6}|black|white", picture)
    assert "currentColor" in picture
