import numpy as np
import pytest

from midair.physics import SensorModel, lazy_sensing, sense, sense_lazily
from midair.streaming import LazyFrames

MIXED = SensorModel(crosstalk=np.eye(16) + 0.05, saturation=2.0).with_spread(seed=1)


@pytest.mark.parametrize("model", [SensorModel(), MIXED], ids=["alone", "mixed"])
def test_lazy_sensing_equals_sensing(model, monkeypatch):
    """To the last bit: the converter's steps are far above the rounding of sums."""
    monkeypatch.setattr(lazy_sensing, "_FRAMES", 100)
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
