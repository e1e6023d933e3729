import numpy as np
import pytest

from midair.physics import SKINS, TOUCH_CHANNELS, SkinMotion, Tissue, skin_compliance

SLOW = 2 * np.pi * 0.5


def test_slow_changes_press_a_half_space_as_statics_say(subtests):
    for k in [60.0, 300.0, 2000.0]:
        with subtests.test(k=k):
            # Boussinesq: u = (1 - nu) p / (mu k).
            still = Tissue(viscosity=0.0)
            assert skin_compliance(still, k, SLOW) == pytest.approx(1 / (2 * still.stiffness * k), rel=1e-3)
            squeezed = Tissue(viscosity=0.0, poisson=0.3)
            assert skin_compliance(squeezed, k, SLOW) == pytest.approx(0.7 / (squeezed.stiffness * k), rel=1e-3)


def test_the_surface_wave_of_a_half_space_is_rayleighs():
    # The root of (2 - x)^2 = 4 sqrt(1 - x) with x = (c / c_T)^2 is .9553^2.
    tissue, omega = Tissue(viscosity=1e-3), 2 * np.pi * 100
    shear = np.sqrt(tissue.stiffness / tissue.density)
    k = omega / (shear * np.linspace(0.94, 0.97, 3001))
    fastest = omega / k[np.argmax(np.abs(skin_compliance(tissue, k, omega)))]
    assert fastest / shear == pytest.approx(0.9553, abs=1e-4)


def test_a_layer_is_a_half_space_where_it_is_thick_and_squeezes_as_an_oedometer_does():
    k, omega = np.array([100.0, 400.0, 1000.0]), 2 * np.pi * 200
    deep, thick = Tissue(), Tissue(depth=0.2)
    np.testing.assert_allclose(skin_compliance(thick, k, omega), skin_compliance(deep, k, omega), rtol=1e-3)
    # u = p h / (lambda + 2 mu), and nothing where volume stays.
    tissue = Tissue(viscosity=0.0, poisson=0.45, depth=0.01)
    oedometric = 2 * tissue.stiffness * (1 - tissue.poisson) / (1 - 2 * tissue.poisson)
    assert skin_compliance(tissue, 0.05, SLOW) == pytest.approx(tissue.depth / oedometric, rel=1e-3)
    kept = abs(skin_compliance(Tissue(viscosity=0.0, depth=0.01), 1.0, SLOW))
    # k^2 h^3 / (3 mu): what a thin film squeezes out sideways (lubrication).
    assert kept == pytest.approx(1e-6 / (3 * 15e3), rel=1e-2)


def test_a_disc_of_5_mm_and_100_pa_presses_as_another_program_found(subtests):
    for depth, micrometres in [(None, 16.7), (20e-3, 13.3), (10e-3, 10.0), (5e-3, 5.2)]:
        with subtests.test(depth=depth):
            # u = p a integral of H(k) J1(k a) dk in the middle; half space: p a / (2 mu).
            from scipy.special import j1

            tissue, radius = Tissue(viscosity=0.0, poisson=0.495 if depth else 0.5, depth=depth), 5e-3
            step = 1.0
            k = np.arange(step / 2, 20e3, step)
            moved = 100 * radius * step * (skin_compliance(tissue, k, SLOW).real * j1(k * radius)).sum()
            assert 1e6 * moved == pytest.approx(micrometres, abs=0.1)


def test_a_layer_agrees_with_its_equations_solved_as_they_stand():
    # Tractions at the top and displacements at the bone, by potentials, without elimination.
    tissue, k, omega = Tissue(stiffness=20e3, poisson=0.4, depth=8e-3), 350.0 + 4j, 2 * np.pi * 150
    mu, h = tissue.stiffness + 1j * omega * tissue.viscosity, tissue.depth
    kt2 = tissue.density * omega**2 / mu
    a, b, s, jk = np.sqrt(k**2 - kt2 * 0.2 / 1.2), np.sqrt(k**2 - kt2), 2 * k**2 - kt2, 1j * k
    ea, eb = np.exp(-a * h), np.exp(-b * h)
    rows = [
        [-2 * jk * a, 2 * jk * a * ea, -s, -s * eb],
        [s, s * ea, -2 * jk * b, 2 * jk * b * eb],
        [jk * ea, jk, b * eb, -b],
        [-a * ea, a, jk * eb, jk],
    ]
    A, B, C, D = np.linalg.solve(np.array(rows), np.array([0, -1 / mu, 0, 0]))
    assert skin_compliance(tissue, k, omega) == pytest.approx(-a * A + a * ea * B + jk * (C + eb * D), rel=1e-9)


def test_the_stiffest_skin_is_the_one_that_moves_least():
    moved = {name: abs(skin_compliance(tissue, 300.0, 2 * np.pi * 30)) for name, tissue in SKINS.items()}
    assert min(moved, key=moved.__getitem__) == "stiff, on bone"
    assert max(moved, key=moved.__getitem__) == "soft, deep"


def test_channels_are_whole_where_they_feel_best_and_fall_by_12_and_9_db_an_octave_away():
    assert TOUCH_CHANNELS["P"].weight(np.array([250.0])) == pytest.approx([1.0])
    assert TOUCH_CHANNELS["NP I"].weight(np.array([10.0, 25.0, 40.0])) == pytest.approx([1.0, 1.0, 1.0])
    assert TOUCH_CHANNELS["P"].weight(np.array([125.0, 500.0])) == pytest.approx([0.2512, 0.3548], abs=1e-4)
    assert [channel.weight(np.zeros(1))[0] for channel in TOUCH_CHANNELS.values()] == [0.0, 0.0]


RATE, PITCH, SIDE = 2000.0, 2.5e-3, 25


def _motion(tissue=None):
    return SkinMotion.of(tissue or Tissue(depth=0.01), (SIDE, SIDE), pitch=PITCH, rate=RATE)


@pytest.fixture(scope="module")
def motion():
    return _motion()


@pytest.mark.long
def test_a_gaussian_pressure_moves_the_skin_as_the_integral_over_wavenumbers(subtests):
    for name in SKINS:
        with subtests.test(name=name):
            # A Gaussian of pressure has a Gaussian spectrum; sums on the real axis, far past the grid's finest ripple.
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


@pytest.mark.long
def test_pressures_of_any_length_move_the_skin_as_their_sum_does(motion):
    pressure = np.random.default_rng(0).standard_normal((1500, SIDE, SIDE))
    whole, early = motion.displacement(pressure), np.where(np.arange(1500)[:, None, None] < 507, pressure, 0)
    moved = motion.displacement(early) + motion.displacement(pressure - early)
    assert whole.shape == pressure.shape
    np.testing.assert_allclose(moved, whole, atol=1e-3 * np.abs(whole).max())
    np.testing.assert_allclose(motion.displacement(early[:507]), motion.displacement(early)[:507], atol=1e-9)


def test_steady_pressure_moves_nothing_in_the_band(motion):
    moved = motion.displacement(np.full((3000, SIDE, SIDE), 100.0))
    assert np.abs(moved[1300:1700]).max() < 1e-3 * np.abs(moved).max()
