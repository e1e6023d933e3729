import numpy as np
import pytest

from midair.devices import VirtualArray, VirtualSkin
from midair.errors import RateError
from midair.model import Drive, Medium, TransducerArray
from midair.physics import focus_phase, radiation_pressure, transfer_matrix
from midair.physics.sensing import SensorModel, cell_weights

ARRAY = TransducerArray.autd3(columns=1, rows=1)
PERFECT = {"strength": 1.0, "spread": 0.0}


def focus(frames=20, level=0.2, rate=1000.0):
    phase = np.broadcast_to(focus_phase(ARRAY, np.array([0, 0, 0.2])), (frames, ARRAY.count))
    return Drive(phase=phase, level=np.full(frames, level), rate=rate, array=ARRAY)


def steady(level=0.2, **options):
    skin = VirtualSkin(SensorModel())
    with VirtualArray(ARRAY, skin, **options) as array:
        array.play(focus(level=level))
    return skin.pressure(0)[-1]


def test_a_steady_focus_presses_as_the_field_says():
    """In closed form: weights of the cells times the radiation pressure of G q at the skin's points."""
    skin = VirtualSkin(SensorModel())
    q = 0.2 * np.exp(1j * focus().phase[0])
    field = transfer_matrix(skin.points, ARRAY) @ q
    expected = cell_weights(skin.model, skin.points) @ radiation_pressure(field, Medium())
    found = steady(phase_bits=30, **PERFECT)
    np.testing.assert_allclose(found.ravel(), expected, rtol=1e-6)


def test_pressure_goes_with_the_square_of_the_level():
    np.testing.assert_allclose(steady(level=0.4, **PERFECT), 4 * steady(level=0.2, **PERFECT), rtol=1e-9)


def test_weaker_transducers_press_less():
    np.testing.assert_allclose(steady(strength=0.9, spread=0.0), 0.81 * steady(**PERFECT), rtol=1e-9)


def test_transducers_take_their_time():
    """After one time constant the envelope has 1 - 1/e of a step at zero detuning: the pressure its square."""
    skin = VirtualSkin(SensorModel(), rate=8000.0)
    with VirtualArray(ARRAY, skin, **PERFECT) as array:
        array.play(focus())
    rise = skin.pressure(0)[:, 1, 1] / skin.pressure(0)[-1, 1, 1]
    gone = np.exp((-1 / 188e-6 + 2j * np.pi * 205) * np.arange(1, 9) / 8000)
    np.testing.assert_allclose(rise[:8], np.abs(1 - gone) ** 2, rtol=1e-3)


def test_blocks_of_a_long_drive_join_without_a_seam():
    long, short = VirtualSkin(SensorModel()), VirtualSkin(SensorModel())
    with VirtualArray(ARRAY, long) as array:
        array.play(focus(frames=300))
    with VirtualArray(ARRAY, short) as array:
        array.play(focus(frames=5))
    np.testing.assert_allclose(long.pressure(0)[40:], np.broadcast_to(long.pressure(0)[-1], (2360, 4, 4)), rtol=0.02)
    np.testing.assert_allclose(long.pressure(0)[:40], short.pressure(0), rtol=1e-9)


def test_a_rate_that_does_not_fit_is_refused():
    with VirtualArray(ARRAY, VirtualSkin(SensorModel())) as array, pytest.raises(RateError, match="whole multiple"):
        array.play(focus(rate=3000.0))


def test_the_same_seed_is_the_same_array():
    np.testing.assert_array_equal(steady(seed=3), steady(seed=3))
    assert not np.array_equal(steady(seed=3), steady(seed=4))
