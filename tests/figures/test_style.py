import base64

import pytest
from jinja2 import UndefinedError

from midair.figures.style import Picture, new_figure, png_bytes, render_page


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


@pytest.mark.parametrize("simulated", ["SIMULATED: no person was asked", "SIMULATED array: nothing could be felt", ""])
def test_says_simulated_when_it_is(simulated):
    page = render_page("study/report.html.j2", title="A <b>", simulated=simulated, pictures=[], findings=[], notes="n")
    assert (f'banner">{simulated}<' in page) is bool(simulated)
    assert "<title>midair: A &lt;b&gt;</title>" in page


def test_a_value_that_is_missing_is_an_error():
    with pytest.raises(UndefinedError):
        render_page("study/report.html.j2", title="A", simulated=False)


def test_a_picture_tells_its_size_and_holds_its_bytes():
    picture = Picture(title="one", data=png_bytes(new_figure(2.0, 1.0, simulated=False), dpi=50))
    assert picture.size == (100, 50)
    assert base64.b64decode(picture.source.partition(",")[2]) == picture.data
