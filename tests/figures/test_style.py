import io

import pytest
from PIL import Image

from midair.figures import STYLE, new_figure, plain_axes, png_bytes


@pytest.mark.parametrize("simulated", [True, False])
def test_simulated_figures_are_marked(simulated):
    figure = new_figure(3.0, 2.0, simulated=simulated)
    assert [text.get_text() for text in figure.texts] == ["SIMULATED"] * simulated


def test_mark_is_not_covered():
    figure = new_figure(3.0, 2.0, simulated=True)
    axis = figure.subplots()
    axis.set_title("a title that would reach the top")
    figure.draw_without_rendering()
    (mark,) = figure.texts
    assert axis.title.get_window_extent().y1 <= mark.get_window_extent().y0 + 1


def test_the_picture_has_the_stated_size():
    image = Image.open(io.BytesIO(png_bytes(new_figure(3.0, 2.0, simulated=False), dpi=50)))
    assert (image.format, image.size) == ("PNG", (150, 100))


def test_axes_have_no_box_and_a_faint_grid_behind_the_data():
    axis = plain_axes(new_figure(3.0, 2.0, simulated=False).subplots())
    assert [side for side, spine in axis.spines.items() if spine.get_visible()] == ["left", "bottom"]
    assert axis.xaxis.get_gridlines()[0].get_color() == STYLE.faint
