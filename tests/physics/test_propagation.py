import tracemalloc

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from midair.model import Acoustics, ControlGrid, Drive, Medium, TransducerArray
from midair.physics import (
    focus_amplitude,
    focus_phase,
    off_axis,
    propagate,
    quantise_phase,
    radiation_pressure,
    relative_error,
    sound_amplitude,
    transfer_matrix,
    wavenumber,
)

LOSSLESS = Medium(attenuation=0)
FOCUS = np.array([0.0, 0.0, 0.2])


@pytest.fixture(scope="module")
def array():
    return TransducerArray.autd3()


def sources(*places, normal=(0.0, 0.0, 1.0)):
    return TransducerArray(position=np.array(places), normal=np.broadcast_to(normal, (len(places), 3)))


def focus_rms(array, phase, medium=LOSSLESS):
    drive = Drive(phase=phase[None], level=np.ones(1), rate=1000.0, array=array)
    return np.abs(
        propagate(drive, FOCUS[None], acoustics=Acoustics(medium=medium, directivity="point"))[0, 0]
    ) / np.sqrt(2)


def test_focus_of_four_units_agrees_with_the_emulator(array):
    exact = focus_phase(array, FOCUS)
    field = transfer_matrix(FOCUS[None], array)[0] * np.exp(1j * exact)
    assert np.angle(field) == pytest.approx(np.zeros(array.count), abs=1e-9), "all in step"
    assert focus_rms(array, exact) == pytest.approx(12875.36, abs=0.005)
    rounded = focus_rms(array, quantise_phase(exact, bits=8))
    assert rounded == pytest.approx(12875.038, rel=1e-6)
    assert rounded == pytest.approx(12875.03, abs=0.005)


def test_fields_of_one_transducer_tilted_or_not_and_of_two_mirror_images():
    one = sources((0.0, 0.0, 0.0))
    medium = Medium(attenuation=0.15)
    distance = 0.25
    field = transfer_matrix(np.array([[0, 0, distance]]), one, acoustics=Acoustics(medium=medium))[0, 0]
    k = 2 * np.pi * 40e3 / 340
    assert wavenumber(one, medium) == pytest.approx(739.198, abs=1e-3)
    assert field == pytest.approx(4.385900 / distance * np.exp((1j * k - 0.15) * distance), rel=1e-6)
    normal = np.array([0.6, 0.0, 0.8])
    tilted = sources((0.0, 0.0, 0.0), normal=normal)
    ahead, aside = transfer_matrix(
        np.array([0.2 * normal, [0.0, 0.0, 0.2]]), tilted, acoustics=Acoustics(medium=LOSSLESS)
    )[:, 0]
    assert abs(ahead) == pytest.approx(tilted.pressure / 0.2)
    assert abs(aside) < 0.85 * abs(ahead)
    # positions of two mirror images around x = 0
    two = sources((-0.03, 0.01, 0.0), (0.03, 0.01, 0.0))
    left = transfer_matrix(np.array([[-0.02, 0.0, 0.2]]), two)
    right = transfer_matrix(np.array([[0.02, 0.0, 0.2]]), two)
    assert left == pytest.approx(right[:, ::-1], rel=1e-12)


@given(st.tuples(*[st.floats(-0.2, 0.2)] * 2, st.floats(0.05, 0.4)), st.tuples(*[st.floats(-0.2, 0.2)] * 3))
def test_a_point_source_and_a_point_change_places(point, source):
    assume(np.linalg.norm(np.subtract(point, source)) > 1e-3)
    there = transfer_matrix(np.array([point]), sources(source), acoustics=Acoustics(directivity="point"))
    back = transfer_matrix(np.array([source]), sources(point), acoustics=Acoustics(directivity="point"))
    assert there == pytest.approx(back, rel=1e-12)


def test_the_field_is_linear_in_the_drive_and_in_the_air_that_it_was_solved_for(array):
    rng = np.random.default_rng(3)
    grid = ControlGrid(rows=2, columns=3)
    phase = rng.uniform(0, 2 * np.pi, (2, array.count))
    level = rng.uniform(0, 1, (2, array.count))
    both = Drive(phase=phase, level=level, rate=1000.0, array=array)
    matrix = transfer_matrix(grid, array)
    assert propagate(both, grid) == pytest.approx((matrix @ (level * np.exp(1j * phase)).T).T, rel=1e-12)
    half = Drive(phase=phase, level=level / 2, rate=1000.0, array=array)
    assert propagate(half, grid) == pytest.approx(propagate(both, grid) / 2, rel=1e-12)
    warm = Acoustics(medium=Medium.at(temperature=25.0), directivity="point")
    drive = Drive(phase=np.zeros((1, array.count)), level=np.ones(1), rate=1000.0, array=array, acoustics=warm)
    np.testing.assert_array_equal(propagate(drive, FOCUS[None]), propagate(drive, FOCUS[None], acoustics=warm))
    assert np.abs(propagate(drive, FOCUS[None]) / propagate(drive, FOCUS[None], acoustics=Acoustics()) - 1).max() > 0.1


def test_attenuation_takes_nepers_per_metre(array):
    far = np.array([[0.0, 0.0, 0.3]])
    quiet, loud = (
        transfer_matrix(far, array, acoustics=Acoustics(medium=Medium(attenuation=beta))) for beta in (0.3, 0.0)
    )
    distance = np.linalg.norm(far - array.position, axis=1)
    assert np.abs(quiet / loud)[0] == pytest.approx(np.exp(-0.3 * distance), rel=1e-12)


def test_the_strongest_focus_agrees_with_propagation_at_full_drive(array):
    grid = ControlGrid()
    best = focus_amplitude(grid, array)
    assert 14.6e3 < best < 14.8e3  # the linear model's 14.7 kPa at 200 mm
    place = grid.position[np.abs(transfer_matrix(grid, array)).sum(axis=1).argmax()]
    drive = Drive(phase=focus_phase(array, place)[None], level=np.ones(1), rate=1000.0, array=array)
    assert np.abs(propagate(drive, place[None]))[0, 0] == pytest.approx(best, rel=1e-9)
    assert 1400 < radiation_pressure(np.array([best]), Medium())[0] < 1600


@given(st.floats(0, 2 * np.pi), st.integers(1, 12))
def test_rounded_phases_are_near_and_on_the_steps(phase, bits):
    rounded = quantise_phase(np.array([phase]), bits=bits)
    step = 2 * np.pi / 2**bits
    assert 0 <= rounded[0] < 2 * np.pi
    assert np.abs(np.angle(np.exp(1j * (rounded - phase))))[0] <= step / 2 + 1e-12
    assert rounded[0] / step == pytest.approx(round(rounded[0] / step), abs=1e-9)


def test_a_row_is_the_same_to_the_last_bit_beside_any_other_and_single_precision_keeps_the_phases(array):
    places = ControlGrid(rows=13, columns=11).position
    for kind in KINDS:
        acoustics = Acoustics(directivity=kind)
        together = transfer_matrix(places, array, acoustics=acoustics)
        alone = np.concatenate([transfer_matrix(place[None], array, acoustics=acoustics) for place in places])
        np.testing.assert_array_equal(together, alone, err_msg=kind)
    exact, single = (transfer_matrix(ControlGrid(), array, precision=kind) for kind in ("double", "single"))
    assert single.dtype == np.complex64
    assert np.abs(single / exact - 1).max() < 1e-4


@pytest.mark.long
def test_temporary_memory_of_a_matrix_is_constant(array):
    sizes = []
    for side in (16, 48):
        places = ControlGrid(rows=side, columns=side).position
        tracemalloc.start()
        matrix = transfer_matrix(places, array)
        sizes.append(tracemalloc.get_traced_memory()[1] - matrix.nbytes)
        tracemalloc.stop()
    assert sizes[1] < 1.1 * sizes[0] < 20e6


KINDS = ("point", "piston", "t4010a1")
K = 2 * np.pi * 40e3 / 340


def test_directivities_at_known_angles():
    for kind in KINDS:
        assert off_axis(np.zeros(3), kind, wavenumber=K) == pytest.approx(np.ones(3))
    assert off_axis(np.linspace(0, np.pi, 50), "point", wavenumber=K).tolist() == [1.0] * 50
    piston = off_axis(np.radians([20, 30, 40]), "piston", wavenumber=K)
    assert piston == pytest.approx([0.847, 0.692, 0.528], abs=5e-4)
    # j_1,1 = 3.8317; a source of 9 mm radius is large enough for its first zero to lie before 90 degrees
    zero = np.arcsin(3.8317060 / (K * 9e-3))
    assert off_axis(np.array([zero]), "piston", wavenumber=K, radius=9e-3)[0] == pytest.approx(0, abs=1e-8)
    measured = off_axis(np.radians([0, 20, 30, 40, 50, 60, 70, 80]), "t4010a1", wavenumber=K)
    assert measured == pytest.approx([1, 1, 0.891, 0.708, 0.501, 0.355, 0.251, 0.200], abs=5e-4)
    knots = np.arange(10, 90, 10)
    below, above = (off_axis(np.radians(knots + step), "t4010a1", wavenumber=K) for step in (-1e-6, 1e-6))
    assert below == pytest.approx(above, abs=1e-6), "the pieces of the measured table join"


@given(st.floats(0, np.pi / 2))
def test_nothing_is_louder_than_the_axis_and_the_back_of_the_measured_table_mirrors_its_front(angle):
    for kind in KINDS:
        assert abs(off_axis(np.array([angle]), kind, wavenumber=K)[0]) <= 1 + 1e-9, kind
    front, back = off_axis(np.array([angle, np.pi - angle]), "t4010a1", wavenumber=K)
    assert back == pytest.approx(front, abs=1e-9)


def test_the_relative_error_by_hand_and_that_it_is_the_paper_s_residual_at_the_best_phases():
    assert relative_error(np.array([[3j, 1.0]]), np.array([[3.0, 4.0]])) == pytest.approx([3 / 5])
    amplitude, silent = np.array([[1.0, 2.0, 0.5]]), np.zeros((1, 3))
    turned = amplitude * np.exp(1j * np.array([0.3, -2.0, 1.0]))
    assert relative_error(turned, amplitude) == pytest.approx([0.0], abs=1e-15), "phase does not matter"
    assert relative_error(silent, silent) == [0.0]
    assert relative_error(amplitude, silent) == [np.inf]
    assert relative_error(silent, amplitude) == [1.0]
    # || G q - diag(p) u || over || p || at u = the field's own phases, and no other phases do better.
    rng = np.random.default_rng(0)
    field = rng.standard_normal(20) + 1j * rng.standard_normal(20)
    p = rng.random(20)
    best = np.exp(1j * np.angle(field))
    residual = np.linalg.norm(field - p * best) / np.linalg.norm(p)
    assert relative_error(field[None], p[None])[0] == pytest.approx(residual)
    others = np.exp(1j * rng.uniform(0, 2 * np.pi, (100, 20)))
    assert (np.linalg.norm(field - p * others, axis=1) / np.linalg.norm(p) >= residual).all()


pressures = st.floats(1e-6, 1e5)
media = st.builds(Medium, density=st.floats(0.5, 2), speed=st.floats(300, 400), alpha=st.floats(1, 2))


def test_radiation_pressure_by_hand():
    # c sqrt(2 rho P / alpha) = 340 sqrt(125)
    assert sound_amplitude(np.array(100.0), Medium()) == pytest.approx(3801.3156, abs=1e-4)
    assert radiation_pressure(np.array([3801.3156]), Medium()) == pytest.approx(100.0, abs=1e-5)
    # alpha rms^2 / (rho c^2)
    medium = Medium(density=1.2, speed=343.0, alpha=1.7)
    assert radiation_pressure(np.array(1000 * np.sqrt(2)), medium) == pytest.approx(1.7e6 / (1.2 * 343.0**2))


@given(pressures, media, st.floats(-np.pi, np.pi))
def test_pressure_there_and_back_is_that_of_the_magnitude(pressure, medium, phase):
    amplitude = sound_amplitude(np.array([pressure]), medium)
    assert radiation_pressure(amplitude, medium) == pytest.approx([pressure], rel=1e-12)
    assert radiation_pressure(amplitude * np.exp(1j * phase), medium) == pytest.approx([pressure])
