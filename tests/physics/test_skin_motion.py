import numpy as np
import pytest

from midair.errors import InputError, ShapeError
from midair.physics import SKINS, SkinMotion, Tissue, skin_compliance

RATE, PITCH, SIDE = 2000.0, 2.5e-3, 25


def _motion(tissue=None):
    return SkinMotion.of(tissue or Tissue(depth=0.01), (SIDE, SIDE), pitch=PITCH, rate=RATE)


@pytest.fixture(scope="module")
def motion():
    return _motion()


@pytest.mark.parametrize("name", SKINS)
def test_a_gaussian_pressure_moves_the_skin_as_the_integral_over_wavenumbers(name):
    # A Gaussian of pressure has a Gaussian spectrum; by sums on the real axis, far past the grid's finest ripple.
    from scipy.special import j0

    tissue, f, width = SKINS[name], 100.0, 5e-3
    place = (np.arange(SIDE) - SIDE // 2) * PITCH
    spot = np.exp(-(place**2 + place[:, None] ** 2) / (2 * width**2))
    time = np.arange(1200) / RATE
    moved = _motion(tissue).displacement(np.cos(2 * np.pi * f * time)[:, None, None] * spot)[500:700, SIDE // 2]
    found = 2 * (moved * np.exp(-2j * np.pi * f * time[500:700, None])).mean(axis=0)
    k = np.arange(0.01, 1500, 0.02)
    spectrum = skin_compliance(tissue, k, 2 * np.pi * f) * k * width**2 * np.exp(-((k * width) ** 2) / 2)
    wanted = [0.02 * (spectrum * j0(k * abs(x))).sum() for x in place[12:20]]
    np.testing.assert_allclose(found[12:20], wanted, rtol=2e-3, atol=2e-3 * abs(wanted[0]))


def test_parts_of_any_length_move_the_skin_as_the_whole_does(motion):
    pressure = np.random.default_rng(0).standard_normal((1500, SIDE, SIDE))
    whole = motion.displacement(pressure)
    parts = list(motion.parts(np.split(pressure, [1, 500, 507])))
    assert whole.shape == pressure.shape
    assert max(len(part) for part in parts) <= 1000
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-3 * np.abs(whole).max())


def test_steady_pressure_moves_nothing_in_the_band(motion):
    moved = motion.displacement(np.full((3000, SIDE, SIDE), 100.0))
    assert np.abs(moved[1300:1700]).max() < 1e-3 * np.abs(moved).max()


def test_zero_pressure_gives_zero_motion(motion):
    assert motion.displacement(np.zeros((3, SIDE, SIDE))).shape == (3, SIDE, SIDE)


def test_another_grid_and_another_band_are_refused(motion):
    with pytest.raises(ShapeError, match=r"\(frame, 25, 25\), got \(9, 3, 3\)"):
        motion.displacement(np.zeros((9, 3, 3)))
    with pytest.raises(InputError, match="below half the rate of 800 Hz, got 20 to 470 Hz"):
        SkinMotion.of(Tissue(), (9, 9), pitch=PITCH, rate=800.0)
