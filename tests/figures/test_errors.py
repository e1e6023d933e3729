import dataclasses
from itertools import product

import numpy as np
import pytest

from midair.evaluate import Leak, StageOutput, budget
from midair.figures import budget_figure, error_figure, passes_figure, trials_figure
from midair.model import Drive, Solution, TransducerArray


def spread(name, middle):
    where = {"recording": name, "variant": "", "strength": middle / 10}
    return where | {"p5": middle / 2, "mean": middle, "p95": 2 * middle, "worst": 4 * middle}


def test_one_row_per_trial_in_percent(check_figure):
    figure = trials_figure([spread("towel", 0.05), spread("brush", 0.1)])
    check_figure(figure, "E (%)", simulated=True)
    (axis,) = figure.axes
    assert [label.get_text() for label in axis.get_yticklabels()] == ["towel", "brush"]
    bottom, top = axis.get_ylim()
    assert bottom > top
    band, middle, worst = axis.lines[:3]
    assert band.get_xdata() == pytest.approx([2.5, 10])
    assert (middle.get_xdata()[0], worst.get_xdata()[0]) == pytest.approx((5, 20))
    assert axis.get_xlim()[1] > 40
    assert {"strength", "0.005", "0.010"} <= {text.get_text() for text in axis.texts}


ARRAY = TransducerArray.autd3(columns=1, rows=1)


def solution(status="iterations"):
    drive = Drive(phase=np.ones((4, ARRAY.count)), level=np.ones(4), rate=1000.0, array=ARRAY)
    return Solution(drive=drive, error=np.full(4, 0.1), iterations=np.full(4, 5), status=(status,) * 4)


def test_error_in_percent_over_seconds_with_the_papers_range(check_figure):
    for status, simulated in product(("iterations", "silent"), (True, False)):
        check_figure(error_figure(solution(status), simulated=simulated), "time (s)", "E (%)", simulated=simulated)
    axis = error_figure(solution(), simulated=False, published=(0.02, 0.3)).axes[0]
    assert axis.lines[0].get_ydata() == pytest.approx([10] * 4)
    assert axis.get_legend().get_texts()[0].get_text() == "paper, static patterns: 2–30 %"
    # Silent frames leave a gap.
    half = dataclasses.replace(solution(), status=("silent", "silent", "iterations", "iterations"))
    line = error_figure(half, simulated=False).axes[0].lines[0]
    np.testing.assert_array_equal(np.isnan(line.get_ydata()), [True, True, False, False])


def test_one_line_per_loop_in_percent(check_figure):
    for simulated in [True, False]:
        figure = passes_figure([("noise", [0.5, 0.3, 0.2]), ("bursts", [0.4])], simulated=simulated)
        check_figure(figure, "pass", "error of the waveform (%)", simulated=simulated)
        (axis,) = figure.axes
        assert axis.lines[0].get_xydata().tolist() == [[1, 50], [2, 30], [3, 20]]
        assert axis.get_ylim()[0] == 0
        assert [text.get_text() for text in axis.get_legend().get_texts()] == ["noise", "bursts"]


LEAK = Leak(peak=0.5, typical=0.2, place=(0.0, 0.0), wanted=1.0)


@pytest.mark.long
def test_a_row_of_panels_for_each_budget(tones, check_figure):
    for simulated in [True, False]:

        def made(factor, simulated=simulated):
            pressure = tones(factor, simulated=simulated)
            outputs = [StageOutput(name="one", what="", pressure=pressure, leak=LEAK)]
            return budget(tones(simulated=simulated), outputs, strength=0.1)

        close, far = made(0.9), made(0.2)
        figure = budget_figure([("paper", far), ("best", close)])
        check_figure(figure, "(dB)", "Hz", "paper, strength 0.10", "best, strength 0.10", simulated=simulated)
        shown = [axis.patches[0].get_width() for axis in figure.axes[::2]]
        assert shown == pytest.approx([each.stages[0].so_far.distortion_ratio for each in (far, close)])
        assert shown[0] < shown[1]
