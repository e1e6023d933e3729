"""Error of the passes of a loop."""

import pytest

from midair.figures import passes_figure


@pytest.mark.parametrize("simulated", [True, False])
def test_one_line_per_loop_in_percent(check_figure, simulated):
    figure = passes_figure([("noise", [0.5, 0.3, 0.2]), ("bursts", [0.4])], simulated=simulated)
    check_figure(figure, "pass", "error of the waveform (%)", simulated=simulated)
    (axis,) = figure.axes
    assert axis.lines[0].get_xydata().tolist() == [[1, 50], [2, 30], [3, 20]]
    assert axis.get_ylim()[0] == 0
    assert [text.get_text() for text in axis.get_legend().get_texts()] == ["noise", "bursts"]


def test_more_loops_than_colours():
    figure = passes_figure([(str(number), [0.5]) for number in range(9)], simulated=True)
    colours = [line.get_color() for line in figure.axes[0].lines]
    assert len(set(colours)) == 7
    assert colours[7] == colours[0]
