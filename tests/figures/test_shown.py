import re

import numpy as np
import pytest

from midair.evaluate import compare
from midair.figures import figure_of
from midair.model import AmplitudeFrames, ControlGrid, Drive, Recording, Solution, TransducerArray

ARRAY = TransducerArray.autd3(columns=1, rows=1)


def things(tones):
    drive = Drive(phase=np.zeros((3, 249)), level=np.array([0.1, 1.0, 0.2]), rate=1000.0, array=ARRAY)
    amplitude = np.ones((3, 256)) * np.arange(3)[:, None]
    return [
        Recording(samples=tones().pressure, rate=1000.0),
        tones(),
        AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=ControlGrid()),
        drive,
        Solution(drive=drive, error=np.zeros(3), iterations=np.ones(3, int), status=("iterations",) * 3),
        compare(tones(), tones(0.5)),
    ]


@pytest.mark.long
def test_whatever_a_stage_returns_draws_itself_and_is_shown_in_a_notebook(tones):
    for thing in things(tones):
        assert len(thing.plot().axes) >= 2, thing
        shown = thing._repr_html_()
        assert re.match(r'<pre>&lt;\w+ .*&gt;</pre><img src="data:image/png;base64,', shown)
        assert len(shown) < 100_000


def test_a_long_curve_keeps_its_extremes():
    samples = np.zeros((5000, 4, 4))
    samples[1234, 1, 2], samples[1235, 1, 2] = 3.0, -2.0
    curve, cells = figure_of(Recording(samples=samples, rate=1000.0)).axes[:2]
    (line,) = curve.lines
    time, values = line.get_xydata().T
    assert (values.max(), values.min(), len(values)) == (3.0, -2.0, 2000)
    assert time[values.argmax()] == pytest.approx(1.23, abs=0.006)
    assert curve.get_title("left") == "channel 6"
    assert cells.images[0].origin == "lower"
