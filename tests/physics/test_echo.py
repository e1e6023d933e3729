"""The echo between palm and array; the judges are closed forms and an independent sum in double precision."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from midair.model import Acoustics, ControlGrid, Medium, Palm, TransducerArray
from midair.physics import echo_matrix, mean_reflection, transfer_matrix, wavenumber
from midair.physics.echo import _radiated
from midair.solvers.phases import spreading_phase

ARRAY, AIR = TransducerArray.autd3(), Acoustics()
K = wavenumber(ARRAY, AIR.medium)
HERE = np.array([0.0, 0.0, 0.2])
PITCH = 11e-3 / 3


def test_a_disc_radiates_as_its_closed_form_on_the_axis() -> None:
    """p(z) = exp(j k z) - z / R exp(j k R) with R² = z² + a² (Osterberg & Smith, J. Opt. Soc. Am. 51, 1961)."""
    pitch, radius = 0.25e-3, 20e-3
    disc = Palm.disc(2 * radius, pitch=pitch).points(np.zeros(3))
    z = np.array([0.03, 0.1, 0.2])
    axis = np.stack([0 * z, 0 * z, z], axis=1)
    found = _radiated(axis, disc, K, np.array([0.0, 0.0, pitch**2])).sum(axis=1)
    edge = np.hypot(z, np.sqrt(len(disc) * pitch**2 / np.pi))
    np.testing.assert_allclose(found, np.exp(1j * K * z) - z / edge * np.exp(1j * K * edge), atol=0.03)


def test_the_mean_echo_over_heights_is_that_of_a_weaker_face() -> None:
    height = np.random.default_rng(0).normal(0, 0.5e-3, 200_000)
    assert mean_reflection(0.5, 0.5e-3, K) == pytest.approx(0.5 * np.exp(2j * K * height).mean().real, abs=2e-3)
    assert (mean_reflection(0.5j, 0.0, K), mean_reflection(0.5, 3e-3, K)) == (0.5j, 0)


def test_a_disc_scatters_as_by_the_boundary_elements_of_acoustools() -> None:
    """A rigid disc of 40 mm (k a = 14.7), closed by a back 4 mm behind, in triangles of a sixth of a wavelength.

    Kirchhoff's approximation lacks the currents at the edge, a share of about 1 / sqrt(k a) of the scattered sound.
    """
    bem, torch = pytest.importorskip("acoustools.BEM"), pytest.importorskip("torch")
    from acoustools.Mesh import calculate_features
    from acoustools.Utilities import forward_model_batched
    from scipy.spatial import Delaunay
    from vedo import Mesh

    radius, rings = 20e-3, 14
    flat = np.concatenate(
        [[[0.0, 0.0]], *(n / rings * radius * _circle(6 * n) for n in range(1, rings + 1))],
    )
    faces, count = Delaunay(flat).simplices, len(flat)
    one, two = flat[faces[:, 1]] - flat[faces[:, 0]], flat[faces[:, 2]] - flat[faces[:, 0]]
    double = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    faces = np.where(double[:, None] < 0, faces[:, ::-1], faces)[np.abs(double) > 1e-9]
    edge = np.arange(count - 6 * rings, count)
    following = np.roll(edge, -1)
    sides = [[edge, following, following + count], [edge, following + count, edge + count]]
    front = np.column_stack([flat, 0 * flat[:, 0]])
    triangles = np.concatenate([faces[:, ::-1], faces + count, *(np.column_stack(side) for side in sides)])
    mesh = Mesh([np.concatenate([front, front + np.array([0, 0, 4e-3])]), triangles])
    mesh.compute_cell_size()
    mesh.compute_normals(points=False, consistency=False)
    calculate_features(mesh)
    sources = np.array([[x, y, -0.1] for x in (-0.03, 0.0, 0.025) for y in (-0.02, 0.03)])
    points = np.array([[x, y, -0.1] for x in np.linspace(-0.05, 0.05, 9) for y in (-0.04, -0.01, 0.02)])
    skin = Palm.disc(2 * radius, pitch=PITCH).points(np.zeros(3))
    board, there, on = (torch.tensor(each, dtype=torch.complex64) for each in (sources, points.T[None], skin.T[None]))
    H = bem.compute_H(mesh, board)
    _, _, G, H = bem.compute_E(mesh, there, board, H=H, return_components=True, use_cache_H=False)
    scattered, arriving = (G @ H)[0].numpy(), forward_model_batched(on, board)[0].numpy()
    own = _radiated(points, skin, 2 * np.pi * 40e3 / 343, PITCH**2 * np.array([0, 0, 1.0])) @ arriving
    assert np.linalg.norm(own - scattered) < 0.15 * np.linalg.norm(scattered)


def _circle(count: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def test_the_echo_is_that_of_an_independent_program() -> None:
    """Echo over direct sound, rms on the cells, for drives whose sound is spread over them.

    The other program has an own field of the array and sums over points of 3 mm on the palm and 4 mm on the face.
    """
    rng, air = np.random.default_rng(0), Acoustics(medium=Medium.at())
    grid = ControlGrid()
    psi, G = spreading_phase(grid, ARRAY, air.medium), transfer_matrix(grid, ARRAY, acoustics=air)
    drives = []
    for _ in range(12):
        size = np.sqrt(np.clip(1 + 0.5 * rng.standard_normal(16), 0.1, None)).reshape(4, 4)
        drives.append(np.angle((size.repeat(4, 0).repeat(4, 1).ravel() * np.exp(1j * psi)) @ G.conj()))
    line, q, found = (np.arange(19) - 9) * 2.5e-3, np.exp(1j * np.array(drives)), {}
    flat = np.stack([*(each.ravel() for each in np.meshgrid(line, line)), np.zeros(361)], axis=1)
    for tilt in (0, 5, 10, 15):
        turn = Rotation.from_euler("x", tilt, degrees=True).as_matrix()
        points = flat[np.abs(flat).max(axis=1) <= 22e-3] @ turn.T + HERE
        skin = Palm.disc(pitch=PITCH).points(np.zeros(3)) @ turn.T + HERE
        echo = echo_matrix(points, skin, ARRAY, area=PITCH**2 * turn[:, 2], acoustics=air)
        direct = transfer_matrix(points, ARRAY, acoustics=air)
        found[tilt] = np.linalg.norm(q @ echo.T) / np.linalg.norm(q @ direct.T)
    assert found == pytest.approx({0: 0.0822, 5: 0.1124, 10: 0.1057, 15: 0.0552}, rel=0.05)
