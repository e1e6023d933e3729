import pytest

from midair.figures import new_figure


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
