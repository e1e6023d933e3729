"""The echo between palm and array; the judges are closed forms and an independent sum in double precision."""

import numpy as np
import pytest

from midair.model import Acoustics, ControlGrid, Medium, Palm, TransducerArray
from midair.physics import echo_matrix, transfer_matrix, wavenumber
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


@pytest.mark.parametrize(("tilt", "known"), [(0, 0.0822), (5, 0.1124), (10, 0.1057), (15, 0.0552)])
def test_the_echo_is_that_of_an_independent_program(tilt: float, known: float) -> None:
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
    angle = np.radians(tilt)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    line = (np.arange(19) - 9) * 2.5e-3
    flat = np.stack([*(each.ravel() for each in np.meshgrid(line, line)), np.zeros(361)], axis=1)
    points = flat[np.abs(flat).max(axis=1) <= 22e-3] @ turn.T + HERE
    skin = Palm.disc(pitch=PITCH).points(np.zeros(3)) @ turn.T + HERE
    echo = echo_matrix(points, skin, ARRAY, area=PITCH**2 * turn[:, 2], acoustics=air)
    q = np.exp(1j * np.array(drives))
    direct = transfer_matrix(points, ARRAY, acoustics=air)
    assert np.linalg.norm(q @ echo.T) / np.linalg.norm(q @ direct.T) == pytest.approx(known, rel=0.05)
