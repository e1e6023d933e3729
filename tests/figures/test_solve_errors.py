"""E over time, with the paper's range behind it."""

import dataclasses

import numpy as np
import pytest

from midair.figures import error_figure
from midair.model import Drive, Solution, TransducerArray

ARRAY = TransducerArray.autd3(columns=1, rows=1)


def solution(status="iterations"):
    drive = Drive(phase=np.ones((4, ARRAY.count)), level=np.ones(4), rate=1000.0, array=ARRAY)
    return Solution(drive=drive, error=np.full(4, 0.1), iterations=np.full(4, 5), status=(status,) * 4)


@pytest.mark.parametrize("simulated", [True, False])
@pytest.mark.parametrize("status", ["iterations", "silent"])
def test_error_in_percent_over_seconds(check_figure, status, simulated):
    check_figure(error_figure(solution(status), simulated=simulated), "time (s)", "E (%)", simulated=simulated)


def test_the_line_is_in_percent_and_the_papers_range_is_named():
    axis = error_figure(solution(), simulated=False, published=(0.02, 0.3)).axes[0]
    assert axis.lines[0].get_ydata() == pytest.approx([10] * 4)
    assert axis.get_legend().get_texts()[0].get_text() == "paper, static patterns: 2–30 %"


def test_silent_frames_leave_a_gap_in_the_error():
    half = dataclasses.replace(solution(), status=("silent", "silent", "iterations", "iterations"))
    line = error_figure(half, simulated=False).axes[0].lines[0]
    np.testing.assert_array_equal(np.isnan(line.get_ydata()), [True, True, False, False])
