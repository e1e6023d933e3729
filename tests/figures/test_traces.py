import numpy as np
import pytest

from midair.figures import beam_figure, exposure_figure, png_bytes, spectra_figure, traces_figure
from midair.files import profile_named
from midair.model import Drive, TransducerArray
from midair.physics import exposure


@pytest.mark.long
@pytest.mark.parametrize("simulated", [True, False])
def test_traces_have_a_panel_a_channel_on_one_scale(tones, check_figure, simulated):
    figure = traces_figure(tones(simulated=simulated), tones(0.5, simulated=False))
    check_figure(figure, "(s)", "(Pa)", simulated=simulated)
    assert len(figure.axes) == 16
    assert len({axis.get_ylim() for axis in figure.axes}) == 1
    original, reproduced = figure.axes[2].lines
    assert np.ptp(original.get_ydata()) > 1.5 * np.ptp(reproduced.get_ydata())
    assert original.get_linewidth() > 2 * reproduced.get_linewidth(), "not covered by the line in front of it"


def test_spectra_are_of_positive_pressure_in_db(tones, check_figure):
    figure = spectra_figure([("a", tones()), ("b", tones(0.1, simulated=False))])
    check_figure(figure, "(Hz)", "dB re 1 Pa²/Hz", "channel 2", "channel 14", simulated=True)
    strong, weak = (line.get_xydata() for line in figure.axes[0].lines)
    at = np.argmin(np.abs(strong[:, 0] - 100))
    assert strong[at, 1] == strong[:, 1].max()
    assert figure.axes[0].lines[0].get_linewidth() > 2 * figure.axes[0].lines[1].get_linewidth()
    # a tenth of the tone: 20 dB less, but for the share that 1 Pa at 300 Hz has in the rectified wave
    assert strong[at, 1] - weak[at, 1] == pytest.approx(20, abs=3)


def test_spectra_end_with_the_last_frequency_in_the_picture(tones):
    figure = spectra_figure([("a", tones()), ("b", tones(0.1))], channels=(2,), rectified=False)
    assert 300 < figure.axes[0].get_xlim()[1] < 350 < figure.axes[0].lines[0].get_xdata()[-1]


@pytest.mark.parametrize("simulated", [True, False])
def test_the_beam_s_line_has_its_gain_and_intercept(check_figure, simulated):
    figure = beam_figure(np.arange(6.0), 2 * np.arange(6.0) + 1, gain=2, intercept=1, simulated=simulated)
    check_figure(figure, "commanded amplitude (Pa)", "measured amplitude (Pa)", simulated=simulated)
    line, points = figure.axes[0].lines
    assert line.get_xydata().tolist() == [[0, 1], [5, 11]]
    assert points.get_ydata().tolist() == [1, 3, 5, 7, 9, 11]


ARRAY = TransducerArray.autd3(columns=1, rows=1)


def test_every_place_has_its_line_and_its_limit():
    drive = Drive(
        phase=np.random.default_rng(0).uniform(0, 6, (50, ARRAY.count)),
        level=np.repeat([0.0, 1.0], 25),
        rate=1000.0,
        array=ARRAY,
    )
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
