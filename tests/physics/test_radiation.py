import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import NegativePressureError
from midair.model import Medium
from midair.physics import radiation_pressure, sound_amplitude

pressures = st.floats(1e-6, 1e5)
media = st.builds(Medium, density=st.floats(0.5, 2), speed=st.floats(300, 400), alpha=st.floats(1, 2))


def test_hundred_pascals_need_3801_pascals_of_sound():
    # c sqrt(2 rho P / alpha) = 340 sqrt(125)
    assert sound_amplitude(np.array(100.0), Medium()) == pytest.approx(3801.3156, abs=1e-4)
    assert radiation_pressure(np.array([3801.3156]), Medium()) == pytest.approx(100.0, abs=1e-5)


def test_pressure_is_alpha_rms_squared_over_rho_c_squared():
    rms = 1000.0
    medium = Medium(density=1.2, speed=343.0, alpha=1.7)
    assert radiation_pressure(np.array(rms * np.sqrt(2)), medium) == pytest.approx(1.7 * rms**2 / (1.2 * 343.0**2))


@given(pressures, media)
def test_there_and_back(pressure, medium):
    amplitude = sound_amplitude(np.array([pressure]), medium)
    assert radiation_pressure(amplitude, medium) == pytest.approx([pressure], rel=1e-12)


@given(pressures, media, st.floats(-np.pi, np.pi))
def test_a_complex_amplitude_counts_by_its_magnitude(amplitude, medium, phase):
    turned = np.array([amplitude * np.exp(1j * phase)])
    assert radiation_pressure(turned, medium) == pytest.approx(radiation_pressure(np.array([amplitude]), medium))


@given(pressures, media)
def test_four_times_the_pressure_needs_twice_the_sound(pressure, medium):
    one, four = sound_amplitude(np.array([pressure, 4 * pressure]), medium)
    assert four == pytest.approx(2 * one)


def test_nothing_needs_nothing():
    assert sound_amplitude(np.zeros((2, 3)), Medium()).tolist() == np.zeros((2, 3)).tolist()
    assert sound_amplitude(np.zeros(0), Medium()).shape == (0,)


def test_negative_pressure_is_refused():
    with pytest.raises(NegativePressureError, match="-3 Pa"):
        sound_amplitude(np.array([1.0, -3.0]), Medium())
