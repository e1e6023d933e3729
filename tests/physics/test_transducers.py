from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from midair.physics import TransducerDynamics, Transducers, envelope

NOMINAL = complex(-1 / 188e-6, 2 * np.pi * 205)


def test_alike_and_varied_transducers_have_the_spread_of_their_settings():
    alike = Transducers.alike(3)
    np.testing.assert_allclose(alike.pole, NOMINAL)
    np.testing.assert_array_equal(alike.response, 1)
    one = Transducers.varied(2000, TransducerDynamics(detuning=0.0), seed=1, quality_spread=0.1)
    quality = -1 / one.pole.real / 188e-6
    assert np.std(quality) == pytest.approx(0.1, rel=0.05)
    np.testing.assert_allclose(one.response, quality, rtol=1e-12)
    one = Transducers.varied(4000, seed=2, gain=0.9, gain_spread=0.5)
    assert one.response.real.min() == 0
    assert np.mean(one.response.real) == pytest.approx(0.9, rel=0.05)
    spread = {"gain_spread": 0.05, "resonance_spread": 50.0, "quality_spread": 0.05}
    first, again, other = (Transducers.varied(9, seed=seed, **spread) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.response, again.response)
    assert not np.array_equal(first.response, other.response)
    assert first.count == 9


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


RATE = 1000.0


def drive(*phases):
    return np.exp(1j * np.array(phases))[:, None]


def test_one_step_is_an_exponential_and_any_is_that_of_the_differential_equation():
    still = TransducerDynamics(time_constant=200e-6, detuning=0.0)
    response = envelope(np.ones((1, 1), complex), RATE, 10, still)[:, 0]
    assert response == pytest.approx(1 - np.exp(-np.arange(1, 11) * 1e-4 / 200e-6), rel=1e-12)
    dynamics = TransducerDynamics()
    frames = np.random.default_rng(0).uniform(-np.pi, np.pi, 4)
    levels = np.array([1.0, 0.4, 0.9, 0.1])
    q = (levels * np.exp(1j * frames))[:, None]
    pole = -1 / dynamics.time_constant + 1j * dynamics.detuning

    # dq/dt = pole (q - c), with a new c every millisecond
    state, wanted, times = np.zeros(1, complex), [], np.arange(1, 6) / 5 * 1e-3
    for target in q[:, 0]:
        slope = partial(lambda target, _, now: pole * (now - target), target)
        run = solve_ivp(slope, (0, 1e-3), state, t_eval=times, rtol=1e-10, atol=1e-12)
        wanted.extend(run.y[0])
        state = run.y[:, -1]
    assert envelope(q, RATE, 5, dynamics)[:, 0] == pytest.approx(np.array(wanted), abs=1e-8)


def test_a_phase_step_dips_to_the_cosine_of_its_half_and_costs_intensity(subtests):
    still = TransducerDynamics(detuning=0.0)
    for step, intensity in [(np.pi, 0.63), (2.5, None), (np.pi / 2, 0.81), (np.pi / 4, 0.945)]:
        with subtests.test(step=step):
            # without detuning the envelope goes straight from 1 to exp(j step): its nearest point to 0 is cos(step / 2)
            path = np.abs(envelope(drive(step), RATE, 50_000, still, start=np.ones(1, complex))[:, 0])
            assert path.min() == pytest.approx(np.cos(step / 2), abs=1e-4)
            assert intensity is None or np.mean(path**2) == pytest.approx(intensity, abs=0.01)


@settings(deadline=None)
@given(st.integers(1, 8), st.integers(1, 8), st.integers(0, 2**32 - 1))
def test_frame_ends_do_not_depend_on_the_substeps(few, many, seed):
    q = np.random.default_rng(seed).standard_normal((5, 3, 2)) @ np.array([1, 1j])
    coarse = envelope(q, RATE, few, TransducerDynamics())[few - 1 :: few]
    fine = envelope(q, RATE, many, TransducerDynamics())[many - 1 :: many]
    assert coarse == pytest.approx(fine, abs=1e-10)


def test_is_linear_and_goes_on_from_where_it_stopped():
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((2, 6, 4, 2)) @ np.array([1, 1j])
    dynamics = TransducerDynamics()
    both = envelope(2 * a - 1j * b, RATE, 3, dynamics)
    assert both == pytest.approx(2 * envelope(a, RATE, 3, dynamics) - 1j * envelope(b, RATE, 3, dynamics), abs=1e-10)
    first = envelope(a[:2], RATE, 3, dynamics)
    rest = envelope(a[2:], RATE, 3, dynamics, start=first[-1])
    assert np.concatenate([first, rest]) == pytest.approx(envelope(a, RATE, 3, dynamics), abs=1e-12)
