import io

import numpy as np
import pytest
from PIL import Image

from midair.calibration import measure_calibration
from midair.calibration.measure.referenced_take import noise_signal
from midair.figures import png_bytes
from midair.figures.calibration_sheet import calibration_figure
from midair.model import Calibration, SensorGrid
from midair.physics import SensorModel
from midair.rig.bench.calibration_page import CalibrationBench

BENCH = CalibrationBench(model=SensorModel(grid=SensorGrid(rows=1, columns=3)).with_spread(seed=1))


def everything():
    rng = np.random.default_rng(0)
    takes = [BENCH.take(noise_signal(level, 8, rng=rng), number=level) for level in (1, 2, 4, 8, 16)]
    takes += [BENCH.take(noise_signal(8, 8, rng=rng), cell=cell) for cell in range(3)]
    return measure_calibration(takes, quiet=BENCH.quiet(8))


def deaf():
    known = {"sensor": SensorGrid(rows=1, columns=1), "frequency": np.array([1.0, 2.0])}
    return Calibration(response=np.zeros((2, 1, 1)), noise=np.zeros((1, 1)), **known)


@pytest.mark.long
def test_figure_has_no_warning_a_title_and_all_that_was_measured(subtests):
    for make in (everything, deaf):
        with subtests.test(name=make.__name__):
            calibration = make()
            figure = calibration_figure(calibration)
            image = np.asarray(Image.open(io.BytesIO(png_bytes(figure, dpi=40))).convert("L"))
            assert (image < 128).mean() > 0.001
            words = [text.get_text() for text in figure.texts]
            assert ("SIMULATED" in words) == calibration.provenance.simulated
            assert calibration.identifier in figure.get_suptitle()
            empty = [text.get_text() for axis in figure.axes for text in axis.texts]
            assert (calibration.linearity is not None and calibration.crosstalk is not None) == (not empty)


def test_missing_measurements_are_stated():
    figure = calibration_figure(Calibration.flat(SensorGrid()))
    said = " ".join(text.get_text() for axis in figure.axes for text in axis.texts)
    assert said.count("not measured") == 5


def test_channels_can_be_distinguished():
    for rows, named in ((2, 4), (4, 16), (8, 16)):
        sheet = calibration_figure(Calibration.flat(SensorGrid(rows=rows, columns=rows), sensitivity=0.02))
        said = [text.get_text() for text in sheet.axes[0].get_legend().get_texts()]
        assert (len(said), said[0]) == (named, "0")
