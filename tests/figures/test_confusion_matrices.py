"""Confusion matrices: counts in their cells, and names of the rows."""

import numpy as np

from midair.figures import ConfusionPanel, confusion_figures


def test_counts_are_in_their_cells_and_zeros_are_blank():
    counts = np.array([[5, 1], [0, 7]])
    figure = confusion_figures([ConfusionPanel(title="original", names=("a", "b"), counts=counts)] * 2, simulated=True)
    first, second = figure.axes[:2]
    assert [text.get_text() for text in first.texts] == ["5", "1", "", "7"]
    assert [label.get_text() for label in first.get_yticklabels()] == ["a", "b"]
    assert [label.get_text() for label in second.get_xticklabels()] == ["a", "b"]
    assert any("SIMULATED" in text.get_text() for text in figure.texts)
