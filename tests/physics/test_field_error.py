import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import ShapeError
from midair.physics import printed_error, relative_error


def test_by_hand():
    error = relative_error(np.array([[3j, 1.0]]), np.array([[3.0, 4.0]]))
    assert error == pytest.approx([3 / 5])


def test_phase_of_the_field_does_not_matter():
    amplitude = np.array([[1.0, 2.0, 0.5]])
    turned = amplitude * np.exp(1j * np.array([0.3, -2.0, 1.0]))
    assert relative_error(turned, amplitude) == pytest.approx([0.0], abs=1e-15)


@given(st.floats(1e-6, 1e6))
def test_scale_of_both_does_not_matter(scale):
    field, amplitude = np.array([[1.0, 2.0]]), np.array([[1.5, 2.5]])
    assert relative_error(scale * field, scale * amplitude) == pytest.approx(relative_error(field, amplitude))


def test_best_phases_turn_the_paper_s_residual_into_it():
    """|| G q - diag(p) u || over || p || at u = the field's own phases, and no other phases do better."""
    rng = np.random.default_rng(0)
    field = rng.standard_normal(20) + 1j * rng.standard_normal(20)
    p = rng.random(20)
    best = np.exp(1j * np.angle(field))
    residual = np.linalg.norm(field - p * best) / np.linalg.norm(p)
    assert relative_error(field[None], p[None])[0] == pytest.approx(residual)
    others = np.exp(1j * rng.uniform(0, 2 * np.pi, (100, 20)))
    assert (np.linalg.norm(field - p * others, axis=1) / np.linalg.norm(p) >= residual).all()


def test_silence():
    silent, loud = np.zeros((1, 3)), np.ones((1, 3))
    assert relative_error(silent, silent) == [0.0]
    assert relative_error(loud, silent) == [np.inf]
    assert relative_error(silent, loud) == [1.0]


def test_as_printed_is_a_mth_of_it():
    field, amplitude = np.ones((1, 256)), 1.1 * np.ones((1, 256))
    assert printed_error(field, amplitude) == pytest.approx(relative_error(field, amplitude) / 256)


def test_wrong_shape():
    with pytest.raises(ShapeError, match="target's shape"):
        relative_error(np.ones((1, 3)), np.ones((1, 4)))
