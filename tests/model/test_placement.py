import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.model import Placement, TransducerArray


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
