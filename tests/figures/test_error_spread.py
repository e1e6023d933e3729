"""Spread of E in each trial."""

import pytest

from midair.figures import ErrorSpread, trials_figure


def spread(name, middle):
    return ErrorSpread(
        name=name, low=middle / 2, middle=middle, high=2 * middle, worst=4 * middle, strength=middle / 10
    )


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


def test_trials_without_any_error_still_have_an_axis():
    (axis,) = trials_figure([spread("silence", 0.0)]).axes
    assert axis.get_xlim() == (0, 1.04)
