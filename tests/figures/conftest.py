import io

import numpy as np
import pytest
from PIL import Image

from midair.figures import png_bytes
from midair.model import PressureFrames, Provenance


@pytest.fixture(scope="package")
def words():
    """All texts of a figure outside its panels."""

    def said(figure):
        texts = [text.get_text() for text in figure.texts]
        for axis in figure.axes:
            texts += [axis.get_xlabel(), axis.get_ylabel(), axis.get_title(loc="left"), axis.get_title()]
        return " ".join([*texts, figure.get_supxlabel(), figure.get_supylabel()])

    return said


@pytest.fixture(scope="package")
def check_figure(words):
    def check(figure, *units, simulated):
        said = words(figure)
        assert ("SIMULATED" in said) == simulated
        assert [unit for unit in units if unit not in said] == []
        image = np.asarray(Image.open(io.BytesIO(png_bytes(figure, dpi=60))).convert("L"))
        assert image.shape[0] > 90
        assert image.shape[1] > 150
        assert (image < 128).mean() > 0.001

    return check


@pytest.fixture(scope="package")
def tones():
    """100 Hz of a height and 300 Hz of 1 Pa on channel 2, nothing on the others."""

    def frames(factor=1.0, *, simulated=True, rate=2000.0):
        time = np.arange(1000) / rate
        pressure = np.zeros((1000, 16))
        pressure[:, 2] = factor * 10 * np.sin(2 * np.pi * 100 * time) + np.sin(2 * np.pi * 300 * time)
        return PressureFrames(
            pressure=pressure.reshape(-1, 4, 4), rate=rate, provenance=Provenance(simulated=simulated)
        )

    return frames
