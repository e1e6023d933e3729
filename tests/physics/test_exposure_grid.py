"""Lattices reach the faces, have the required spacing, and interpolate between nodes."""

import numpy as np
import pytest

from midair.files import profile_named
from midair.model import Acoustics, TransducerArray
from midair.physics import transfer_matrix
from midair.physics.exposure_modes import bands, between, lattice, middle, slow_field, stacks
from midair.physics.exposure_places import combined

ARRAY = TransducerArray.autd3()
EAR = profile_named("occupational-110").places[0]


def test_a_lattice_reaches_the_faces_and_crowds_there():
    axis = lattice(np.array([12.0, 4.0, 2.0]), 1.0)[0]
    assert (axis[0], axis[-1]) == (-1, 1)
    gaps = np.diff(axis)
    assert gaps.max() * 12 < 1.0
    assert gaps[0] < gaps[len(gaps) // 2]
    np.testing.assert_allclose(axis, -axis[::-1], atol=1e-12)


@pytest.mark.parametrize("wave", [0.0, 3.3, 8.0])
def test_waves_between_nodes(wave):
    nodes, at = lattice(np.array([8.0, 2.0, 2.0]), 1.6)[0], np.linspace(-1, 1, 50)
    found = between(nodes, at, 8.0) @ np.exp(1j * wave * nodes)
    np.testing.assert_allclose(found, np.exp(1j * wave * at), atol=5e-3)


def test_the_slow_field_is_the_transfer_matrix_but_for_a_wave_from_the_middle():
    share = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    points = np.array(EAR.position) + EAR.reach * share
    path = np.linalg.norm(points - middle(ARRAY), axis=1, keepdims=True)
    wave = np.exp(-1j * 2 * np.pi * ARRAY.frequency / Acoustics().medium.speed * path)
    true = transfer_matrix(points, ARRAY) * wave
    magnitude = np.abs(transfer_matrix(EAR.points, ARRAY))
    found = slow_field(share, place=EAR, array=ARRAY, acoustics=Acoustics(), magnitude=magnitude)
    np.testing.assert_allclose(found, true, atol=4e-3 * np.abs(true).max())


def test_stacks_are_the_inside_and_all_of_the_surface_each_point_once():
    found = [each.points.reshape(-1, 3) for each in stacks(np.array([3.0, 8.0, 5.0]), inside=1.6, faces=1.0)]
    assert (np.abs(found[0]) < 1).all()
    surface = np.concatenate(found[1:])
    assert (np.abs(surface).max(axis=1) == 1).all()
    assert len(np.unique(surface.round(9), axis=0)) == len(surface)
    closer = lattice(np.array([3.0, 8.0, 5.0]), 1.0)
    assert len(surface) == (np.abs(combined(*closer)).max(axis=1) == 1).sum()


def test_bands_are_how_far_a_phase_turns_from_the_middle_of_the_cube_to_a_face():
    """Two transducers on the x axis, seen from far above: sin = 0.1 on either side of the middle, k reach 0.1."""
    array = TransducerArray(position=np.array([[-0.1, 0, 0], [0.1, 0, 0]]), normal=np.array([[0, 0, 1.0]] * 2))
    far = type(EAR)(name="ear", position=(0.0, 0.0, 1.0), reach=0.05, limit=100.0)
    k = 2 * np.pi * array.frequency / Acoustics().medium.speed
    found = bands(far, array, Acoustics())
    assert found[0] == pytest.approx(k * 0.05 * 0.1, rel=0.06)
    np.testing.assert_allclose(found[1:], 2.0)
