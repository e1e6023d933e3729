import numpy as np
import pytest

from midair.figures import FieldRow, fields_figure, spectra_figure, stimuli_figure
from midair.figures.paper_figures import curve_figure, histogram_figure
from midair.model import ControlGrid, SensorGrid


def row(name, height):
    fields = np.outer([1, height], np.ones(256))
    return FieldRow(name=name, fields=fields, grid=ControlGrid(), notes=("a", "b"))


@pytest.mark.long
def test_fields_are_in_rows_on_one_scale(check_figure):
    figure = fields_figure([row("target", 2), row("made", 7)], SensorGrid(), quantity="sound pressure (Pa)")
    check_figure(figure, "x (mm)", "made\ny (mm)", "sound pressure (Pa)", simulated=True)
    images = [axis.images[0] for axis in figure.axes if axis.images]
    assert {image.get_clim() for image in images} == {(0.0, 7.0)}
    assert [float(np.asarray(image.get_array()).max()) for image in images] == [1, 2, 1, 7]


@pytest.mark.long
def test_stimuli_have_maps_and_traces(tones, check_figure):
    for simulated in [True, False]:
        modes = {"original": tones(simulated=simulated), "paper mode": tones(0.5, simulated=simulated)}
        figure = stimuli_figure({"i": modes}, channels=(2, 15), shown=0.05)
        check_figure(figure, "(ms)", "(Pa)", "i, rms 0 to 7 Pa", simulated=simulated)
        waves = figure.axes[1::2]
        assert len({axis.get_ylim() for axis in waves}) == 1
        # the stated channels last, in the stated order: 50 ms of 2000 Hz
        loud, quiet = waves[0].lines[-2:]
        assert len(loud.get_xdata()) == 100
        # sin x + .1 sin 3x at its top: 10 - 1 Pa
        assert np.ptp(loud.get_ydata()) == pytest.approx(18)
        assert np.ptp(quiet.get_ydata()) == 0


@pytest.mark.long
def test_objects_have_spectra_at_each_channel(tones, check_figure):
    for simulated in [True, False]:
        objects = {"towel": tones(simulated=simulated), "brush": tones(0.5, simulated=simulated)}
        figure = spectra_figure({"plain": objects, "groove": objects}, objects=True)
        check_figure(figure, "(Hz)", "groove\n(dB re 1 Pa²/Hz)", "channel 6", simulated=simulated)
        assert len(figure.axes) == 8
        towel, brush = figure.axes[0].lines[:2]
        at = np.argmin(np.abs(towel.get_xdata() - 100))
        # half the tone: 6 dB less
        assert towel.get_ydata()[at] - brush.get_ydata()[at] == pytest.approx(6.02, abs=0.01)


PUBLISHED = (0.05, 0.15)


def texts(figure):
    return [text.get_text() for text in figure.texts]


def test_a_histogram_counts_every_pattern_and_a_curve_is_drawn_in_percent():
    errors = np.random.default_rng(1).uniform(0.02, 0.2, 500)
    figure = histogram_figure([("strength 0.1", errors)], published=PUBLISHED)
    axes = figure.axes[0]
    outline = axes.patches[1].get_xy()
    assert outline[:, 1].sum() > 0
    assert "500 patterns" in axes.get_legend_handles_labels()[1][1]
    assert axes.get_xlabel() == "E (%)"
    assert "SIMULATED" in texts(figure)
    rows = [{"strength": x, "mean": x / 2, "p5": x / 4, "p95": x} for x in (0.1, 0.2, 0.3)]
    figure = curve_figure({"150 mm": rows, "200 mm": rows}, "strength", published=PUBLISHED)
    np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata(), [5, 10, 15])
    assert figure.axes[0].get_xlabel() == "strength (of a single focus)"
