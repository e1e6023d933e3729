import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import InputError
from midair.physics import off_axis

KINDS = ("point", "piston", "t4010a1")
K = 2 * np.pi * 40e3 / 340


@pytest.mark.parametrize("kind", KINDS)
def test_the_axis_is_one(kind):
    assert off_axis(np.zeros(3), kind, wavenumber=K) == pytest.approx(np.ones(3))


def test_a_point_radiates_evenly():
    assert off_axis(np.linspace(0, np.pi, 50), "point", wavenumber=K).tolist() == [1.0] * 50


@pytest.mark.parametrize(("degrees", "value"), [(20, 0.847), (30, 0.692), (40, 0.528)])
def test_the_piston_at_hand_computed_angles(degrees, value):
    assert off_axis(np.radians([degrees]), "piston", wavenumber=K)[0] == pytest.approx(value, abs=5e-4)


def test_the_piston_has_its_first_zero_where_the_bessel_function_has():
    # j_1,1 = 3.8317; a source of 9 mm radius is large enough for it to lie before 90 degrees
    angle = np.arcsin(3.8317060 / (K * 9e-3))
    assert off_axis(np.array([angle]), "piston", wavenumber=K, radius=9e-3)[0] == pytest.approx(0, abs=1e-8)


@pytest.mark.parametrize(
    ("degrees", "value"),
    [(0, 1), (20, 1), (30, 0.891), (40, 0.708), (50, 0.501), (60, 0.355), (70, 0.251), (80, 0.200)],
)
def test_the_measured_table_at_its_knots(degrees, value):
    assert off_axis(np.radians([degrees]), "t4010a1", wavenumber=K)[0] == pytest.approx(value, abs=5e-4)


def test_the_measured_table_joins_its_pieces():
    knots = np.arange(10, 90, 10)
    below, above = (off_axis(np.radians(knots + step), "t4010a1", wavenumber=K) for step in (-1e-6, 1e-6))
    assert below == pytest.approx(above, abs=1e-6)


@given(st.floats(0, np.pi / 2))
def test_the_back_of_the_measured_table_mirrors_its_front(angle):
    front, back = off_axis(np.array([angle, np.pi - angle]), "t4010a1", wavenumber=K)
    assert back == pytest.approx(front, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@given(angle=st.floats(0, np.pi / 2))
def test_nothing_is_louder_than_the_axis(kind, angle):
    assert abs(off_axis(np.array([angle]), kind, wavenumber=K)[0]) <= 1 + 1e-9


def test_any_shape_is_kept():
    angles = np.linspace(0, 1.5, 24).reshape(2, 3, 4)
    for kind in KINDS:
        whole = off_axis(angles, kind, wavenumber=K)
        assert whole.shape == angles.shape
        assert whole.ravel() == pytest.approx(off_axis(angles.ravel(), kind, wavenumber=K))


def test_an_unknown_kind_is_refused():
    with pytest.raises(InputError, match=r"point, piston, t4010a1.*'horn'"):
        off_axis(np.zeros(1), "horn", wavenumber=K)
