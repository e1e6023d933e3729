import base64

import pytest
from jinja2 import UndefinedError

from midair.figures.style import Picture, new_figure, png_bytes, render_page


def test_simulated_figures_are_marked_and_the_mark_is_not_covered():
    assert new_figure(3.0, 2.0, simulated=False).texts == []
    figure = new_figure(3.0, 2.0, simulated=True)
    axis = figure.subplots()
    axis.set_title("a title that would reach the top")
    figure.draw_without_rendering()
    (mark,) = figure.texts
    assert mark.get_text() == "SIMULATED"
    assert axis.title.get_window_extent().y1 <= mark.get_window_extent().y0 + 1


def test_a_page_says_that_it_is_simulated_and_a_value_that_is_missing_is_an_error():
    known = {"title": "A <b>", "pictures": [], "findings": [], "notes": "n"}
    for simulated in ("SIMULATED: no person was asked", ""):
        page = render_page("study/report.html.j2", simulated=simulated, **known)
        assert (f'banner">{simulated}<' in page) is bool(simulated)
        assert "<title>midair: A &lt;b&gt;</title>" in page
    with pytest.raises(UndefinedError):
        render_page("study/report.html.j2", title="A", simulated=False)


def test_a_picture_tells_its_size_and_holds_its_bytes():
    picture = Picture(title="one", data=png_bytes(new_figure(2.0, 1.0, simulated=False), dpi=50))
    assert picture.size == (100, 50)
    assert base64.b64decode(picture.source.partition(",")[2]) == picture.data
