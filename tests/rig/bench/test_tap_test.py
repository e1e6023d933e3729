import numpy as np
import pytest

from midair.devices import RemappedSensor, ReplaySensor
from midair.errors import DeviceError, InputError
from midair.model import Recording, SensorGrid, SensorWiring
from midair.rig.bench.identify import TapTest, identify_by_taps, identify_by_tones
from midair.rig.names.virtual_rig import VirtualRig

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
    return RemappedSensor(replay, SensorWiring(order=tuple(int(c) for c in np.argsort(order)), unit="V"))


def heard(sensor, test=RHYTHM, skip=lambda: False):
    prompts = []
    with sensor:
        identity = identify_by_taps(sensor, test, prompts.append, skip)
    assert prompts == list(range(16)), "each cell is asked for once, in order"
    return identity


@pytest.mark.parametrize("test", [RHYTHM, TapTest()], ids=["in rhythm", "one by one"])
def test_a_permuted_sensor_is_put_right(test, tapped):
    identity = heard(sensor_of(tapped), test)
    assert identity.channel == ORDER
    assert identity.sound
    right = RemappedSensor(sensor_of(tapped), SensorWiring(order=identity.order, unit="V"))
    assert heard(right, test).in_order


@pytest.mark.parametrize("seed", range(5))
def test_strengths_and_channels_that_differ_do_not_matter(seed):
    with VirtualRig(seed=10 + seed).touched_by("taps") as sensor:
        assert heard(sensor).channel == tuple(range(16))


def test_a_cut_wire_with_noise_is_dead(tapped):
    samples = tapped.copy()
    samples[:, 1, 2] = np.random.default_rng(5).normal(0, 1e-4, len(samples))
    assert heard(sensor_of(samples)).dead == (ORDER[6],)


def test_a_cell_that_never_answers_is_left_out_after_a_while(tapped):
    """Cells 14 and 15 are not tapped any more: the source is quiet to its end."""
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


def test_a_sensor_without_touch_is_an_error():
    samples = np.random.default_rng(0).normal(0, 1e-3, (18_000, 4, 4))
    with sensor_of(samples) as sensor, pytest.raises(InputError, match="got none"):
        identify_by_taps(sensor, RHYTHM, lambda cell: None)


def hums(order, seconds=2.0):
    """A tone of 50 + 25 k Hz in cell k, a fifth of it in every other channel, and noise."""
    t = np.arange(round(seconds * 1000)) / 1000
    tones = np.sin(2 * np.pi * (50 + 25 * np.arange(16)) * t[:, None])
    cells = tones + 0.2 * (tones.sum(axis=1, keepdims=True) - tones)
    samples = np.empty_like(cells)
    samples[:, list(order)] = cells
    samples += np.random.default_rng(1).normal(0, 0.3, samples.shape)
    return ReplaySensor(Recording(samples=samples.reshape(-1, 4, 4), rate=1000.0))


def test_tones_tell_the_order():
    with hums(ORDER) as sensor:
        identity = identify_by_tones(sensor, np.linspace(50, 425, 16), 2.0)
    assert identity.channel == ORDER
    assert identity.sound


def test_one_tone_for_each_cell_is_needed():
    with hums(ORDER) as sensor, pytest.raises(InputError, match="expected 16"):
        identify_by_tones(sensor, np.linspace(50, 425, 4), 2.0)


def test_an_odd_grid_is_identified(tapped):
    grid = SensorGrid(rows=2, columns=8)
    identity = heard(RemappedSensor(sensor_of(tapped, range(16)), SensorWiring(grid=grid, unit="V")))
    assert identity.in_order
