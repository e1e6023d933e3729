from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from midair.model import ControlGrid, Placement, SensorGrid, TransducerArray


def test_four_units_are_centred_on_their_mean_each_in_the_order_of_the_firmware():
    array = TransducerArray.autd3(columns=2, rows=2)
    assert array.count == 996
    assert array.position.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-15)
    assert np.bincount(array.unit).tolist() == [249] * 4
    assert array.normal.tolist() == [[0, 0, 1]] * 996
    assert array.pressure == pytest.approx(4.38590, abs=1e-5)
    one = TransducerArray.autd3(columns=1, rows=1)
    cell = np.rint((one.position - one.position[0])[:, :2] / 10.16e-3).astype(int)
    assert cell[:18].tolist() == [[x, 0] for x in range(18)]
    # the second row misses its columns 1, 2 and 16, where the screws are
    assert cell[18:33].tolist() == [[x, 1] for x in (0, *range(3, 16), 17)]
    assert cell[-1].tolist() == [17, 13]
    assert len(cell) == 249


def test_a_grid_is_the_paper_s_array_and_arrays_are_the_same_to_a_micrometre():
    array = TransducerArray.autd3(columns=1, rows=1)
    assert array.same_as(replace(array, position=array.position + np.array([2e-7, 0, 0])))
    assert not array.same_as(replace(array, position=array.position + np.array([2e-6, 0, 0])))
    assert not array.same_as(replace(array, frequency=70e3))
    assert not array.same_as(TransducerArray.autd3(columns=2, rows=1))
    for grid in ({"columns": 1, "rows": 1}, {"columns": 2, "rows": 2}, {"columns": 3, "rows": 1}):
        assert Placement.grid(**grid).array().same_as(TransducerArray.autd3(**grid)), grid


def test_channels_run_row_by_row_from_the_top_left_surrounded_by_the_papers_control_points():
    sensor = SensorGrid()
    assert sensor.x == pytest.approx([-16.5e-3, -5.5e-3, 5.5e-3, 16.5e-3])
    places = [(-16.5e-3, -16.5e-3), (5.5e-3, -16.5e-3), (5.5e-3, 16.5e-3), (16.5e-3, 16.5e-3)]
    assert [sensor.channel_position(channel) for channel in (0, 2, 14, 15)] == [pytest.approx(each) for each in places]
    assert (sensor.shape, sensor.count) == ((4, 4), 16)
    grid = ControlGrid()
    assert (grid.shape, grid.count) == ((16, 16), 256)
    assert grid.x[[0, -1]] == pytest.approx([-27.5e-3, 27.5e-3])
    # every third point lies on a cell, once the border of one pitch is passed
    assert grid.x[3:-3:3] == pytest.approx(sensor.x)


@given(st.integers(1, 9), st.integers(1, 9), st.tuples(st.floats(-1, 1), st.floats(-1, 1)), st.floats(0.05, 1))
def test_points_run_row_by_row_around_the_centre(rows, columns, centre, height):
    grid = ControlGrid(rows=rows, columns=columns, pitch=5e-3, height=height, centre=centre)
    place = grid.position.reshape(rows, columns, 3)
    assert place[..., 0] == pytest.approx(np.broadcast_to(grid.x + centre[0], (rows, columns)))
    assert place[..., 1] == pytest.approx(np.broadcast_to((grid.y + centre[1])[:, None], (rows, columns)))
    assert (place[..., 2] == height).all()
    assert place.mean(axis=(0, 1)) == pytest.approx([*centre, height], abs=1e-12)


def test_a_quarter_turn_by_hand():
    """About z by 90 degrees, the unit's x axis points along y: the second transducer is 10.16 mm further in y."""
    one = Placement(position=np.zeros((1, 3)), rotation=np.array([[0, 0, np.pi / 2]])).array()
    np.testing.assert_allclose(one.position[1] - one.position[0], [0, 10.16e-3, 0], atol=1e-12)
    tilted = Placement(position=np.zeros((1, 3)), rotation=np.array([[np.pi / 2, 0, 0]])).array()
    np.testing.assert_allclose(tilted.normal[0], [0, -1, 0], atol=1e-12)


angles = st.floats(-3, 3)
places = st.floats(-0.5, 0.5)


@pytest.mark.long
@given(st.lists(st.tuples(places, places, places, angles, angles, angles), min_size=1, max_size=3))
def test_transducers_are_where_both_sdks_say(units):
    commands = pytest.importorskip("midair.devices.arrays.autd3_commands")
    numbers = np.array(units)
    placement = Placement(position=numbers[:, :3], rotation=numbers[:, 3:])
    array, geometry = placement.array(), commands.geometry(placement)
    position = np.concatenate([geometry.device(index).positions() for index in range(len(units))]) * 1e-3
    normal = np.concatenate([geometry.device(index).directions() for index in range(len(units))])
    np.testing.assert_allclose(array.position, position, atol=1e-6)
    np.testing.assert_allclose(array.normal, normal, atol=1e-6)


def test_units_turn_as_scipy_turns_them_also_by_quarter_turns():
    quarters = np.pi / 2 * np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3), axis=-1).reshape(-1, 3)
    angles = np.concatenate([quarters, np.random.default_rng(0).uniform(-7, 7, (200, 3))])
    placement, turns = Placement(position=np.zeros_like(angles), rotation=angles), Rotation.from_euler("xyz", angles)
    np.testing.assert_allclose(placement.quaternion, np.roll(turns.as_quat(), 1, axis=1), atol=1e-12)
    along = placement.array().normal.reshape(len(angles), -1, 3)[:, 0]
    np.testing.assert_allclose(along, turns.apply([0, 0, 1]), atol=1e-12)


def test_older_sdk_s_geometry_agrees():
    pyautd3 = pytest.importorskip("pyautd3")
    placement = Placement(
        position=np.array([[0.1, 0.2, 0.3], [0, 0, 0]]), rotation=np.array([[0.3, -0.2, 0.5], [0, 1, 0]])
    )
    units = [
        pyautd3.AUTD3(pos=at, rot=turn) for at, turn in zip(placement.origin * 1e3, placement.quaternion, strict=True)
    ]
    with pyautd3.Controller.open(units, pyautd3.Nop()) as controller:
        position = np.array([each.position() for unit in controller.geometry() for each in unit]) * 1e-3
    np.testing.assert_allclose(placement.array().position, position, atol=1e-6)
