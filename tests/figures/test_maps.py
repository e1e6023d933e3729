import base64
import io

import numpy as np
import pytest
from PIL import Image

from midair.evaluate import perceptual_metrics
from midair.figures import (
    beam_figure,
    card_figure,
    exposure_figure,
    maps_figure,
    phase_figure,
    png_bytes,
    spectra_figure,
    traces_figure,
)
from midair.figures.maps import map_source, strongest_moment
from midair.files import profile_named
from midair.model import ControlGrid, Drive, PressureFrames, SensorGrid, TransducerArray
from midair.physics import exposure

ARRAY = TransducerArray.autd3(columns=1, rows=1)


@pytest.mark.parametrize("simulated", [True, pytest.param(False, marks=pytest.mark.long)])
def test_maps_have_millimetres_and_a_quantity(check_figure, simulated):
    rng = np.random.default_rng(0)
    values = [("target", rng.random(256)), ("reproduced", rng.random((16, 16)))]
    figure = maps_figure(values, ControlGrid(), quantity="pressure (Pa)", simulated=simulated, sensor=SensorGrid())
    check_figure(figure, "x (mm)", "y (mm)", "pressure (Pa)", "target", simulated=simulated)


def test_cells_are_marked_where_they_lie_and_maps_share_one_scale_and_have_row_0_at_the_top():
    sensor = SensorGrid()
    drawn = maps_figure([("a", np.ones(256))], ControlGrid(), quantity="p (Pa)", simulated=False, sensor=sensor)
    (marks,) = drawn.axes[0].lines
    assert len(marks.get_xdata()) == sensor.count
    assert sorted(set(marks.get_xdata())) == pytest.approx(1e3 * np.sort(sensor.x))
    low, high = np.zeros((4, 4)), np.full((4, 4), 9.0)
    drawn = maps_figure([("a", low), ("b", high)], SensorGrid(), quantity="p (Pa)", simulated=False)
    assert {axis.images[0].get_clim() for axis in drawn.axes[:2]} == {(0.0, 9.0)}
    bottom, top = drawn.axes[0].get_ylim()
    assert bottom > top


@pytest.mark.parametrize("simulated", [pytest.param(True, marks=pytest.mark.long), False])
def test_phases_are_those_of_the_frame_within_a_turn(check_figure, simulated):
    phase = np.random.default_rng(1).uniform(-9, 9, (4, ARRAY.count))
    figure = phase_figure(Drive(phase=phase, level=np.ones(4), rate=1000.0, array=ARRAY), 1, simulated=simulated)
    check_figure(figure, "x (mm)", "y (mm)", "phase (rad)", simulated=simulated)
    (circles,) = figure.axes[0].collections
    np.testing.assert_allclose(np.asarray(circles.get_array()), np.mod(phase[1], 2 * np.pi))
    assert circles.get_clim() == (0, 2 * np.pi)


@pytest.mark.parametrize("simulated", [True, pytest.param(False, marks=pytest.mark.long)])
def test_maps_with_units(tones, check_figure, simulated):
    card = perceptual_metrics(tones(simulated=simulated), tones(0.5, simulated=simulated))
    check_figure(card_figure(card), "dB", "ST-SIM", "SPQI", simulated=simulated)


def test_the_card_s_map_holds_its_numbers(tones):
    card = perceptual_metrics(tones(), tones(0.5))
    texts = {text.get_text() for axis in card_figure(card).axes for text in axis.texts}
    assert f"{card.figure('ST-SIM').channels[0, 2]:.2f}" in texts
    assert "–" in texts


def pressed(rate):
    """A second in which channel 6 is struck at half a second."""
    time = np.arange(int(rate)) / rate
    pressure = np.zeros((len(time), 4, 4))
    pressure[:, 1, 2] = np.where(abs(time - 0.5) < 0.03, 5.0, 0.0)
    return PressureFrames(pressure=pressure, rate=rate, band=(20.0, 400.0))


def test_the_window_and_the_map_of_a_touch():
    cell, begin = strongest_moment(pressed(1000.0), 0.1)
    assert cell == (1, 2)
    assert begin <= 0.471
    assert begin + 0.1 >= 0.529
    source = map_source(np.array([[0.0, np.nan], [1.0, 5.0]]), 2.0)
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(source.partition(",")[2]))).convert("RGBA"))
    assert pixels.shape == (2, 2, 4)
    assert pixels[1, :, 3].tolist() == [0, 0]
    assert pixels[0, :, 3].tolist() == [255, 255]
    assert pixels[0, 1, :3].tolist() == [0x4A, 0x0E, 0x60], "the darkest colour is the top and more"


@pytest.mark.long
def test_traces_have_a_panel_a_channel_on_one_scale(tones, check_figure):
    for simulated in [True, False]:
        figure = traces_figure(tones(simulated=simulated), tones(0.5, simulated=False))
        check_figure(figure, "(s)", "(Pa)", simulated=simulated)
        assert len(figure.axes) == 16
        assert len({axis.get_ylim() for axis in figure.axes}) == 1
        original, reproduced = figure.axes[2].lines
        assert np.ptp(original.get_ydata()) > 1.5 * np.ptp(reproduced.get_ydata())
        assert original.get_linewidth() > 2 * reproduced.get_linewidth(), "not covered by the line in front of it"


@pytest.mark.long
def test_spectra_are_of_positive_pressure_in_db(tones, check_figure):
    figure = spectra_figure({"": {"a": tones(), "b": tones(0.1, simulated=False)}})
    check_figure(figure, "(Hz)", "dB re 1 Pa²/Hz", "channel 2", "channel 14", simulated=True)
    strong, weak = (line.get_xydata() for line in figure.axes[0].lines)
    at = np.argmin(np.abs(strong[:, 0] - 100))
    assert strong[at, 1] == strong[:, 1].max()
    assert figure.axes[0].lines[0].get_linewidth() > 2 * figure.axes[0].lines[1].get_linewidth()
    # a tenth of the tone: 20 dB less, but for the share that 1 Pa at 300 Hz has in the rectified wave
    assert strong[at, 1] - weak[at, 1] == pytest.approx(20, abs=3)


def test_spectra_end_with_the_last_frequency_in_the_picture(tones):
    figure = spectra_figure({"": {"a": tones(), "b": tones(0.1)}}, channels=(2,), rectified=False)
    assert 300 < figure.axes[0].get_xlim()[1] < 350 < figure.axes[0].lines[0].get_xdata()[-1]


def test_the_beam_s_line_has_its_gain_and_intercept(check_figure):
    for simulated in [True, False]:
        figure = beam_figure(np.arange(6.0), 2 * np.arange(6.0) + 1, gain=2, intercept=1, simulated=simulated)
        check_figure(figure, "commanded amplitude (Pa)", "measured amplitude (Pa)", simulated=simulated)
        line, points = figure.axes[0].lines
        assert line.get_xydata().tolist() == [[0, 1], [5, 11]]
        assert points.get_ydata().tolist() == [1, 3, 5, 7, 9, 11]


@pytest.mark.long
def test_every_place_has_its_line_and_its_limit():
    phase = np.random.default_rng(0).uniform(0, 6, (50, ARRAY.count))
    drive = Drive(phase=phase, level=np.repeat([0.0, 1.0], 25), rate=1000.0, array=ARRAY)
    found = exposure(drive, profile_named("occupational-110"))
    figure = exposure_figure(found, simulated=True)
    (axis,) = figure.axes
    assert len(axis.lines) == 8
    assert "dB" in axis.get_ylabel()
    assert "(s)" in axis.get_xlabel()
    drawn = axis.lines[0].get_ydata()
    assert np.isnan(drawn[:25]).all()
    np.testing.assert_allclose(drawn[25:], found.level[25:, 0])
    assert any(text.get_text() == "SIMULATED" for text in figure.texts)
    assert png_bytes(figure).startswith(b"\x89PNG")
