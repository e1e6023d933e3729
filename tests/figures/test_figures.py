"""Every figure draws, has units on its axes, and says so when it shows what was simulated."""

import dataclasses
import io

import numpy as np
import pytest
from PIL import Image

from midair.figures import (
    beam_figure,
    error_figure,
    maps_figure,
    phase_figure,
    png,
    spectra_figure,
    traces_figure,
)
from midair.model import ControlGrid, Drive, PressureFrames, Provenance, SensorGrid, Solution, TransducerArray

ARRAY = TransducerArray.autd3(columns=1, rows=1)
RNG = np.random.default_rng(0)


def pressure(simulated):
    return PressureFrames(
        pressure=RNG.normal(size=(300, 4, 4)), rate=1000.0, provenance=Provenance(simulated=simulated)
    )


def solution(status="iterations"):
    drive = Drive(phase=RNG.uniform(0, 6, (4, ARRAY.count)), level=np.ones(4), rate=1000.0, array=ARRAY)
    return Solution(drive=drive, error=np.full(4, 0.1), iterations=np.full(4, 5), status=(status,) * 4)


def maps(simulated):
    values = [("target", RNG.random(256)), ("reproduced", RNG.random((16, 16)))]
    return maps_figure(values, ControlGrid(), quantity="pressure (Pa)", simulated=simulated, sensor=SensorGrid())


FIGURES = {
    "traces": lambda simulated: traces_figure(pressure(simulated), pressure(False)),
    "traces alone": lambda simulated: traces_figure(pressure(simulated)),
    "spectra": lambda simulated: spectra_figure([("a", pressure(simulated)), ("b", pressure(False))]),
    "beam": lambda simulated: beam_figure(np.arange(6.0), np.arange(6.0), gain=1, intercept=0, simulated=simulated),
    "maps": maps,
    "phase": lambda simulated: phase_figure(solution().drive, 1, simulated=simulated),
    "error": lambda simulated: error_figure(solution(), simulated=simulated),
    "error of silence": lambda simulated: error_figure(solution("silent"), simulated=simulated),
}


@pytest.fixture(params=FIGURES)
def figure(request):
    return FIGURES[request.param]


def words(drawn):
    axes = [axis.get_xlabel() + axis.get_ylabel() for axis in drawn.axes]
    return " ".join([*axes, *(text.get_text() for text in drawn.texts), drawn.get_supxlabel(), drawn.get_supylabel()])


@pytest.mark.parametrize("simulated", [True, False])
def test_says_simulated_when_it_is(figure, simulated):
    assert ("SIMULATED" in words(figure(simulated))) == simulated


def test_axes_have_units(figure):
    said = words(figure(False))
    assert any(f"({unit}" in said for unit in ("Pa", "s)", "Hz", "mm", "rad", "%", "dB"))


def test_draws_something(figure):
    image = np.asarray(Image.open(io.BytesIO(png(figure(True)))).convert("L"))
    assert image.shape[0] > 200
    assert image.shape[1] > 300
    assert (image < 128).mean() > 0.001


def test_maps_share_one_scale():
    low, high = np.zeros((4, 4)), np.full((4, 4), 9.0)
    drawn = maps_figure([("a", low), ("b", high)], SensorGrid(), quantity="p (Pa)", simulated=False)
    limits = {axis.images[0].get_clim() for axis in drawn.axes[:2]}
    assert limits == {(0.0, 9.0)}


def test_row_0_is_at_the_top():
    drawn = maps_figure([("a", np.eye(4))], SensorGrid(), quantity="p (Pa)", simulated=False)
    bottom, top = drawn.axes[0].get_ylim()
    assert bottom > top


def test_silent_frames_leave_a_gap_in_the_error():
    half = dataclasses.replace(solution(), status=("silent", "silent", "iterations", "iterations"))
    line = error_figure(half, simulated=False).axes[0].lines[0]
    np.testing.assert_array_equal(np.isnan(line.get_ydata()), [True, True, False, False])
