import re
import xml.etree.ElementTree as ET

import numpy as np

from midair.model.pictures import POINTS, dots, heat_map, lines


def test_a_line_keeps_every_peak_and_stays_small():
    row = np.zeros(100_000)
    row[54_321] = 1.0
    drawn = lines(row[None], low="a", high="b")
    assert drawn.count("L") < 2 * POINTS
    top = re.findall(r"[ML](\d+) (-?\d+)", drawn)
    assert min(int(y) for _, y in top) == 0


def test_a_flat_line_a_silent_map_and_one_dot_are_drawn():
    for drawn in (
        lines(np.zeros((2, 5)), low="a", high="b"),
        lines(np.full((1, 3), np.nan), low="a", high="b"),
        heat_map(np.zeros((2, 3)), low="a", high="b"),
        dots(np.zeros(1), np.zeros(1), low="a", high="b"),
    ):
        ET.fromstring(drawn)
        assert "nan" not in drawn


def test_a_map_has_row_0_at_the_top():
    drawn = heat_map(np.array([[1.0, 0.0], [0.0, 0.0]]), low="a", high="b")
    cells = re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="60.00"', drawn)
    assert cells == [("0.0", "0.0")]


def test_labels_are_escaped():
    assert "&lt;b&gt;" in lines(np.zeros((1, 2)), low="<b>", high="")
