import numpy as np
import pytest

from midair.physics import SensorModel, sense, sense_lazily
from midair.physics.sensing import channel_volts
from midair.streaming import LazyFrames

MIXED = SensorModel(crosstalk=np.eye(16) + 0.05, saturation=2.0).with_spread(seed=1)


@pytest.mark.parametrize("model", [SensorModel(), MIXED], ids=["alone", "mixed"])
def test_lazy_sensing_equals_sensing(model, monkeypatch):
    """To the last bit: the converter's steps are far above the rounding of sums."""
    monkeypatch.setattr("midair.physics.sensing._FRAMES", 100)
    pressure = 20 * np.random.default_rng(0).standard_normal((2 * 1237, 4, 4))
    wanted = sense(model, pressure, 1000.0, rng=np.random.default_rng(5), oversample=2)
    lazy = LazyFrames(lambda a, b: pressure[a:b], pressure.shape)
    felt = sense_lazily(model, lazy, 1000.0, rng=np.random.default_rng(5), oversample=2)
    np.testing.assert_array_equal(felt, wanted)
    np.testing.assert_array_equal(felt[700:900], wanted[700:900])


@pytest.mark.parametrize(("bits", "stored"), [(16, "f4"), (24, "f8")])
def test_it_is_single_where_float32_holds_every_step(bits, stored):
    model = SensorModel(bits=bits)
    half = 2 ** (bits - 1)
    steps = np.arange(-half, half, max(1, bits**3 // 7)) * model.step
    assert (steps.astype(np.float32) == steps).all() == (stored == "f4")
    quiet = LazyFrames(lambda a, b: np.zeros((b - a, 4, 4)), (10, 4, 4))
    assert sense_lazily(model, quiet, 1000.0).stored == stored


# Steps of the converter far below the rounding of the sums.
FINE = SensorModel(bits=32, full_scale=1e-3, noise=0.0, delay=np.linspace(0, 3e-4, 16).reshape(4, 4)).with_spread(
    seed=3
)


@pytest.mark.parametrize(("steps", "over"), [(801, 8), (800, 8), (3, 8), (500, 1), (1000, 3)])
def test_each_channel_equals_the_result_in_memory(steps, over):
    pressure = 1e-3 * np.random.default_rng(steps).standard_normal((steps, 4, 4))
    whole = sense(FINE, pressure, 1000.0, oversample=over)
    for number in (0, 6, 15):
        cell = pressure.reshape(steps, -1)[:, number]
        volts = channel_volts(FINE, number, lambda first, cell=cell: cell[first::over], steps, 1000.0, oversample=over)
        np.testing.assert_allclose(volts, whole.reshape(len(whole), -1)[:, number], atol=FINE.step)
