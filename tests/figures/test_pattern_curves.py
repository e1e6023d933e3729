import numpy as np

from midair.figures.paper_figures import Curve, Example, curve_figure, examples_figure, histogram_figure
from midair.model import ControlGrid, SensorGrid

PUBLISHED = (0.05, 0.15)


def texts(figure):
    return [text.get_text() for text in figure.texts]


def test_a_histogram_counts_every_pattern():
    errors = np.random.default_rng(1).uniform(0.02, 0.2, 500)
    figure = histogram_figure([("strength 0.1", errors)], published=PUBLISHED)
    axes = figure.axes[0]
    outline = axes.patches[1].get_xy()
    assert outline[:, 1].sum() > 0
    assert "500 patterns" in axes.get_legend_handles_labels()[1][1]
    assert axes.get_xlabel() == "E (%)"
    assert "SIMULATED" in texts(figure)


def test_examples_show_target_above_field_on_one_scale():
    grid = ControlGrid(rows=4, columns=4)
    target, field = np.linspace(0, 1, 16), np.linspace(0, 2, 16)
    one = Example(name="0x0001", error=0.042, target=target, field=field)
    figure = examples_figure([one, one], grid, SensorGrid(), title="strength 0.1")
    images = [axes.images[0] for axes in figure.axes if axes.images]
    np.testing.assert_array_equal(images[0].get_array(), target.reshape(4, 4))
    np.testing.assert_array_equal(images[2].get_array(), field.reshape(4, 4))
    assert {image.get_clim() for image in images} == {(0, 2)}
    assert figure.axes[2].get_title(loc="left") == "E 4.2 %"
    assert "SIMULATED" in texts(figure)


def test_a_curve_is_drawn_in_percent():
    x = np.array([0.1, 0.2, 0.3])
    curve = Curve(name="200 mm", x=x, mean=x / 2, low=x / 4, high=x)
    figure = curve_figure([curve, curve], quantity="strength", published=PUBLISHED)
    np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata(), [5, 10, 15])
    assert figure.axes[0].get_xlabel() == "strength"
