import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import midair
from midair.calibration import BeamSetting
from midair.errors import InputError, ShapeError
from midair.model import ControlGrid, Placement, SensorGrid, TransducerArray
from midair.model.geometry import centred
from midair.rig import ArraySession, VirtualRig


def test_four_units_have_996_transducers_centred_on_their_mean():
    array = TransducerArray.autd3(columns=2, rows=2)
    assert array.count == 996
    assert array.position.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-15)
    assert np.bincount(array.unit).tolist() == [249] * 4
    assert array.normal.tolist() == [[0, 0, 1]] * 996
    assert array.pressure == pytest.approx(4.38590, abs=1e-5)


def test_a_unit_in_the_order_of_the_firmware():
    one = TransducerArray.autd3(columns=1, rows=1)
    cell = np.rint((one.position - one.position[0])[:, :2] / 10.16e-3).astype(int)
    assert cell[:18].tolist() == [[x, 0] for x in range(18)]
    # the second row misses its columns 1, 2 and 16, where the screws are
    assert cell[18:33].tolist() == [[x, 1] for x in (0, *range(3, 16), 17)]
    assert cell[-1].tolist() == [17, 13]
    assert len(cell) == 249


def test_arrays_are_the_same_to_a_micrometre():
    array = TransducerArray.autd3(columns=1, rows=1)
    moved = TransducerArray(position=array.position + np.array([2e-6, 0, 0]), normal=array.normal)
    nudged = TransducerArray(position=array.position + np.array([2e-7, 0, 0]), normal=array.normal)
    higher = TransducerArray(position=array.position, normal=array.normal, frequency=70e3)
    assert array.same_as(nudged)
    assert not array.same_as(moved)
    assert not array.same_as(higher)
    assert not array.same_as(TransducerArray.autd3(columns=2, rows=1))


def test_a_bad_array_is_refused():
    with pytest.raises(InputError, match="unit vectors"):
        TransducerArray(position=np.zeros((2, 3)), normal=np.ones((2, 3)))
    with pytest.raises(ShapeError, match="transducer position"):
        TransducerArray(position=np.zeros((2, 2)), normal=np.ones((2, 3)))
    with pytest.raises(ShapeError, match="transducer unit"):
        TransducerArray(position=np.zeros((2, 3)), normal=np.tile([0, 0, 1], (2, 1)), unit=np.zeros(3, int))
    with pytest.raises(InputError, match="at least 1 x 1, got 0 x 2"):
        TransducerArray.autd3(columns=0)


def test_channels_run_row_by_row_from_the_top_left():
    sensor = SensorGrid()
    assert sensor.x == pytest.approx([-16.5e-3, -5.5e-3, 5.5e-3, 16.5e-3])
    assert sensor.channel_position(0) == pytest.approx((-16.5e-3, -16.5e-3))
    assert sensor.channel_position(2) == pytest.approx((5.5e-3, -16.5e-3))
    assert sensor.channel_position(14) == pytest.approx((5.5e-3, 16.5e-3))
    assert sensor.channel_position(15) == pytest.approx((16.5e-3, 16.5e-3))
    assert (sensor.shape, sensor.count) == ((4, 4), 16)


@pytest.mark.parametrize("channel", [-1, 16])
def test_a_channel_that_is_not_there_is_refused(channel):
    with pytest.raises(ShapeError, match=f"0 to 15, got {channel}"):
        SensorGrid().channel_position(channel)


def test_the_papers_control_points_surround_the_cells():
    grid, sensor = ControlGrid(), SensorGrid()
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


@given(st.integers(1, 50), st.floats(1e-4, 1))
def test_centred_places_mirror(count, pitch):
    places = centred(count, pitch)
    assert places == pytest.approx(-places[::-1], abs=1e-12)
    assert np.diff(places) == pytest.approx(np.full(count - 1, pitch))


@pytest.mark.parametrize(
    ("kind", "wrong", "error"),
    [
        (SensorGrid, {"rows": 0}, ShapeError),
        (SensorGrid, {"columns": 1.5}, ShapeError),
        (SensorGrid, {"rows": float("nan")}, ShapeError),
        (SensorGrid, {"columns": float("inf")}, ShapeError),
        (SensorGrid, {"pitch": 0.0}, InputError),
        (ControlGrid, {"rows": -1}, ShapeError),
        (ControlGrid, {"pitch": float("nan")}, InputError),
        (ControlGrid, {"height": -0.2}, InputError),
    ],
)
def test_a_bad_grid_is_refused(kind, wrong, error):
    with pytest.raises(error, match="expected"):
        kind(**wrong)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ControlGrid(height=200), r"height: expected 0.02 to 1 m, got 200 m; .* 200 mm is 0.2$"),
        (lambda: ControlGrid(height=3), r"height: expected 0.02 to 1 m, got 3 m$"),
        (lambda: ControlGrid(height=float("nan")), r"height: expected 0.02 to 1 m, got nan m$"),
        (lambda: ControlGrid(pitch=3.7), r"pitch: expected 1e-06 to 0.2 m, got 3.7 m; .* 3.7 mm is 0.0037$"),
        (lambda: SensorGrid(pitch=11), r"pitch: expected 1e-06 to 0.2 m, got 11 m; .* 11 mm is 0.011$"),
        (lambda: VirtualRig(height=200), r"height: .* 200 mm is 0.2$"),
        (lambda: BeamSetting(height=200), r"height: .* 200 mm is 0.2$"),
        (lambda: ArraySession(height=200), r"height: .* 200 mm is 0.2$"),
        (lambda: midair.open_rig("virtual", height=200), r"height: .* 200 mm is 0.2$"),
        (lambda: midair.live("virtual:towel", "virtual", height=200), r"height: .* 200 mm is 0.2$"),
    ],
    ids=["height", "between", "nan", "points", "cells", "rig", "beam", "array", "open_rig", "live"],
)
def test_a_length_in_millimetres_is_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize(("columns", "rows"), [(1, 1), (2, 2), (3, 1)])
def test_a_grid_is_the_paper_s_array(columns, rows):
    assert Placement.grid(columns=columns, rows=rows).array().same_as(TransducerArray.autd3(columns=columns, rows=rows))


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
