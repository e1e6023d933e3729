"""Maps of one quantity on one scale, and phases on the array."""

import numpy as np
import pytest

from midair.figures import maps_figure, phase_figure
from midair.model import ControlGrid, Drive, SensorGrid, TransducerArray

ARRAY = TransducerArray.autd3(columns=1, rows=1)


@pytest.mark.parametrize("simulated", [True, False])
def test_maps_have_millimetres_and_a_quantity(check_figure, simulated):
    rng = np.random.default_rng(0)
    values = [("target", rng.random(256)), ("reproduced", rng.random((16, 16)))]
    figure = maps_figure(values, ControlGrid(), quantity="pressure (Pa)", simulated=simulated, sensor=SensorGrid())
    check_figure(figure, "x (mm)", "y (mm)", "pressure (Pa)", "target", simulated=simulated)


def test_maps_share_one_scale():
    low, high = np.zeros((4, 4)), np.full((4, 4), 9.0)
    drawn = maps_figure([("a", low), ("b", high)], SensorGrid(), quantity="p (Pa)", simulated=False)
    limits = {axis.images[0].get_clim() for axis in drawn.axes[:2]}
    assert limits == {(0.0, 9.0)}


def test_row_0_is_at_the_top():
    drawn = maps_figure([("a", np.eye(4))], SensorGrid(), quantity="p (Pa)", simulated=False)
    bottom, top = drawn.axes[0].get_ylim()
    assert bottom > top


def test_cells_are_marked_where_they_lie():
    sensor = SensorGrid()
    drawn = maps_figure([("a", np.ones(256))], ControlGrid(), quantity="p (Pa)", simulated=False, sensor=sensor)
    (marks,) = drawn.axes[0].lines
    assert len(marks.get_xdata()) == sensor.count
    assert sorted(set(marks.get_xdata())) == pytest.approx(1e3 * np.sort(sensor.x))


@pytest.mark.parametrize("simulated", [True, False])
def test_phases_are_those_of_the_frame_within_a_turn(check_figure, simulated):
    phase = np.random.default_rng(1).uniform(-9, 9, (4, ARRAY.count))
    figure = phase_figure(Drive(phase=phase, level=np.ones(4), rate=1000.0, array=ARRAY), 1, simulated=simulated)
    check_figure(figure, "x (mm)", "y (mm)", "phase (rad)", simulated=simulated)
    (circles,) = figure.axes[0].collections
    np.testing.assert_allclose(np.asarray(circles.get_array()), np.mod(phase[1], 2 * np.pi))
    assert circles.get_clim() == (0, 2 * np.pi)
