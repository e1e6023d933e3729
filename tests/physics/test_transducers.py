import numpy as np
import pytest

from midair.errors import InputError, ShapeError
from midair.physics import TransducerDynamics, Transducers

NOMINAL = complex(-1 / 188e-6, 2 * np.pi * 205)


def test_alike_ones_have_the_pole_of_their_dynamics_and_the_strength_of_the_model():
    alike = Transducers.alike(3)
    np.testing.assert_allclose(alike.pole, NOMINAL)
    np.testing.assert_array_equal(alike.response, 1)


def test_another_resonance_settles_at_the_ratio_of_the_poles():
    """s = p0 / p: a resonance 1 kHz off lowers the amplitude to |p0 / p| and changes the phase."""
    one = Transducers.varied(2000, seed=1, resonance_spread=300.0)
    off = one.pole.imag / (2 * np.pi) - 205
    assert np.std(off) == pytest.approx(300, rel=0.05)
    np.testing.assert_allclose(one.pole.real, NOMINAL.real)
    np.testing.assert_allclose(one.response * one.pole, NOMINAL, rtol=1e-12)
    nearest = int(np.argmin(np.abs(off + 205)))  # resonance at the drive: in step, and the strongest of all
    assert np.abs(one.response[nearest]) == pytest.approx(np.abs(NOMINAL) * 188e-6, rel=1e-4)
    assert np.abs(one.response).max() == pytest.approx(np.abs(one.response[nearest]), rel=1e-4)


def test_quality_sets_time_constant_and_strength_together():
    one = Transducers.varied(2000, TransducerDynamics(detuning=0.0), seed=1, quality_spread=0.1)
    quality = -1 / one.pole.real / 188e-6
    assert np.std(quality) == pytest.approx(0.1, rel=0.05)
    np.testing.assert_allclose(one.response, quality, rtol=1e-12)


def test_strengths_spread_about_their_mean_and_never_below_zero():
    one = Transducers.varied(4000, seed=2, gain=0.9, gain_spread=0.5)
    assert one.response.real.min() == 0
    assert np.mean(one.response.real) == pytest.approx(0.9, rel=0.05)


def test_the_same_seed_is_the_same_array():
    spread = {"gain_spread": 0.05, "resonance_spread": 50.0, "quality_spread": 0.05}
    first, again, other = (Transducers.varied(9, seed=seed, **spread) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.response, again.response)
    assert not np.array_equal(first.response, other.response)
    assert first.count == 9


def test_impossible_settings_are_refused():
    with pytest.raises(InputError, match="expected a real part below 0"):
        Transducers(pole=np.ones(2, complex), response=np.ones(2, complex))
    with pytest.raises(ShapeError, match="response"):
        Transducers(pole=-np.ones(2, complex), response=np.ones(3, complex))
    with pytest.raises(InputError, match="0 or more"):
        Transducers.varied(2, seed=0, gain_spread=-0.1)
