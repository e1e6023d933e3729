"""Channel identification with permuted, cut and doubled wires and responses of neighbouring cells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.devices import ReplaySensor, WrappedSensor
from midair.errors import DeviceError
from midair.model import Recording, SensorGrid, SensorWiring
from midair.rig.bench.identify import (
    TapTest,
    assignment_problems,
    identify,
    identify_by_taps,
)
from midair.rig.names.sensor_names import VirtualRig

GRID = SensorGrid()
NOISE = np.full(16, 1e-3)


def answers(order, *, crosstalk=0.3, strength=None, gain=None):
    """answer[cell, channel] where cell k is wired to channel order[k] and neighbours feel a part of a tap."""
    row, column = np.divmod(np.arange(16), 4)
    away = np.abs(row[:, None] - row) + np.abs(column[:, None] - column)
    felt = np.where(away == 0, 1.0, crosstalk**away)
    if strength is not None:
        felt = felt * np.asarray(strength)[:, None]
    answer = np.zeros((16, 16))
    answer[:, list(order)] = felt
    return answer if gain is None else answer * np.asarray(gain)


def found(order, **options):
    return identify(answers(order, **options), NOISE, GRID)


def test_the_margin_is_that_of_a_swap_of_neighbours():
    """Two neighbours that feel .3 of each other's taps: both answers fall by 10.46 dB if they are exchanged."""
    np.testing.assert_allclose(found(range(16)).margin, -20 * np.log10(0.3), atol=1e-9)


@given(
    order=st.permutations(range(16)),
    strength=st.lists(st.floats(0.05, 1), min_size=16, max_size=16),
    gain=st.lists(st.floats(0.1, 3), min_size=16, max_size=16),
    crosstalk=st.floats(0, 0.6),
)
def test_any_order_is_found_whatever_strengths_gains_and_neighbours(order, strength, gain, crosstalk):
    identity = found(order, strength=strength, gain=gain, crosstalk=crosstalk)
    assert identity.channel == tuple(order)
    assert identity.order == tuple(order)
    assert identity.sound
    assert identity.in_order == (list(order) == list(range(16)))


def test_a_turned_sensor_is_recognised_and_other_orders_are_listed():
    cells = np.arange(16).reshape(4, 4)
    (said,) = assignment_problems(found(cells[::-1, ::-1].ravel()))
    assert "turned by 180 degrees" in said
    (said,) = assignment_problems(found(cells.T.ravel()))
    assert "12 channels are in another place (cell: channel that responds): 1: 4, 2: 8" in said


@given(
    order=st.permutations(range(16)),
    dead=st.integers(0, 15),
    strength=st.lists(st.floats(0.5, 1), min_size=16, max_size=16),
)
def test_a_dead_channel_is_found_and_assigned_to_the_remaining_cell(order, dead, strength):
    answer = answers(order, strength=strength)
    answer[:, dead] = 0
    identity = identify(answer, NOISE, GRID)
    cell = list(order).index(dead)
    assert identity.dead == (dead,)
    assert identity.silent == (cell,)
    assert identity.order == tuple(order), "the one channel that is left is the cell's"
    assert not identity.sound
    assert f"channel {dead} is dead" in assignment_problems(identity)[0]


def test_a_doubled_channel_is_found():
    """Channel 9 carries what channel 5 does; nothing carries cell 9."""
    answer = answers(range(16))
    answer[:, 9] = answer[:, 5]
    signals = np.random.default_rng(0).normal(size=(500, 16))
    signals[:, 9] = 0.5 * signals[:, 5] + 1
    identity = identify(answer, NOISE, GRID, signals=signals)
    assert identity.alike == ((5, 9),)
    assert identity.silent == (9,)
    assert identity.channel[5] == 5
    assert assignment_problems(identity)[0] == "channels 5 and 9 carry the same signal: one wire goes to both"


def test_a_wrongly_tapped_cell_is_doubtful():
    """Cell 5 is tapped twice and cell 6 never: the two channels cannot be separated with certainty."""
    answer = answers(range(16), crosstalk=0.9)
    answer[6] = answer[5]
    identity = identify(answer, NOISE, GRID)
    assert {5, 6} <= set(identity.doubtful)
    assert any("not certain" in said for said in assignment_problems(identity))


RHYTHM = TapTest(every=1.0)
ORDER = tuple(int(i) for i in np.random.default_rng(3).permutation(16))


@pytest.fixture(scope="module")
def tapped():
    """Samples of the virtual sensor while every cell is tapped; neighbours receive a quarter of each tap."""
    with VirtualRig(seed=1).touched_by("taps") as sensor:
        sensor.start()
        return sensor.read(17_100).samples


def sensor_of(samples, order=ORDER):
    """A sensor whose cell k is wired to channel order[k]: channel order[k] gets cell k's signal."""
    replay = ReplaySensor(Recording(samples=samples, rate=1000.0))
    return WrappedSensor(replay, SensorWiring(order=tuple(int(c) for c in np.argsort(order)), unit="V"))


def heard(sensor, test=RHYTHM, skip=lambda: False):
    prompts = []
    with sensor:
        identity = identify_by_taps(sensor, test, prompts.append, skip)
    assert prompts == list(range(16)), "each cell is asked for once, in order"
    return identity


def test_a_permuted_sensor_is_put_right(subtests, tapped):
    for test in [RHYTHM, TapTest()]:
        with subtests.test(test=test):
            identity = heard(sensor_of(tapped), test)
            assert identity.channel == ORDER
            assert identity.sound
            right = WrappedSensor(sensor_of(tapped), SensorWiring(order=identity.order, unit="V"))
            assert heard(right, test).in_order


def test_a_cut_wire_with_noise_is_dead_and_a_cell_that_never_answers_is_left_out(tapped):
    samples = tapped.copy()
    samples[:, 1, 2] = np.random.default_rng(5).normal(0, 1e-4, len(samples))
    assert heard(sensor_of(samples)).dead == (ORDER[6],)
    # Cells 14 and 15 are not tapped any more: the source is quiet to its end.
    samples = tapped.copy()
    samples[15_000:] = np.tile(samples[:700], (3, 1, 1))
    identity = heard(sensor_of(samples), TapTest(wait=1.5))
    assert identity.silent == (14, 15)
    assert identity.channel[:14] == ORDER[:14]


def test_a_cell_can_be_left_out_by_hand(tapped):
    """No tap is detected while cell 0 is due; the first tap, which is on cell 0, then counts for cell 1."""
    asked = iter([True])
    identity = heard(sensor_of(tapped, range(16)), TapTest(), lambda: next(asked, False))
    assert identity.channel[1] == 0


def test_a_source_that_ends_in_the_quiet_is_an_error(tapped):
    with sensor_of(tapped[:500]) as sensor, pytest.raises(DeviceError, match="ended early"):
        identify_by_taps(sensor, RHYTHM, lambda cell: None)
