from dataclasses import replace

import numpy as np
import pytest

from midair.model import Acoustics, ControlGrid, Placement, TransducerArray
from midair.solvers import Live, error_of, multi_plane_problem, symmetric_modes
from midair.solvers.mirror_symmetry import full_phase
from midair.solvers.modes import modes

AIR = Acoustics()
GRID = ControlGrid()


def of(array, grid=GRID):
    return symmetric_modes(grid, array, acoustics=AIR, tolerance=5e-3)


def whole(kept):
    """W, shape (transducer, kind * mode), column by column."""
    return np.stack([kept.drive(z) for z in np.eye(len(kept.s), dtype=complex)], axis=1)


@pytest.mark.long
def test_the_kinds_together_make_every_field_of_the_array(subtests):
    for columns, rows in ((2, 2), (1, 1), (3, 2)):
        with subtests.test(columns=columns, rows=rows):
            array = TransducerArray.autd3(columns=columns, rows=rows)
            kept = of(array)
            assert kept.V.shape[0] * kept.V.shape[2] == 252 * columns * rows
            G = multi_plane_problem([GRID.position], np.zeros((1, GRID.count)), array, acoustics=AIR).G
            # Contribution of modes below the tolerance; 249 of 252 places have a transducer.
            assert np.linalg.norm(G - (kept.U * kept.s) @ whole(kept).conj().T) < 4e-3 * np.linalg.norm(G)


@pytest.mark.long
def test_drives_of_different_kinds_have_nothing_in_common():
    """Except for the empty places: twelve of 1008."""
    W = whole(of(TransducerArray.autd3()))
    used = np.linalg.norm(W, axis=0) > 0
    alike = np.abs(W.conj().T @ W - np.diag(used))
    assert alike.max() < 0.1


@pytest.mark.long
def test_a_drive_and_its_mirror_image_are_of_the_same_kinds():
    """A mirror changes only the sign of a kind, checked where both the place and its image have a transducer."""
    array = TransducerArray.autd3()
    kept = of(array)
    middle = (array.position.min(axis=0) + array.position.max(axis=0)) / 2
    places = {tuple(each): n for n, each in enumerate(np.rint((array.position - middle) * 1e6).astype(int))}
    pairs = [(n, places.get((-x, y, z))) for (x, y, z), n in places.items()]
    here, there = np.array([pair for pair in pairs if pair[1] is not None]).T
    assert len(here) > 900
    each = kept.V.shape[1]
    for kind, sign in enumerate((1, -1, 1, -1)):
        z = np.zeros(len(kept.s), complex)
        z[kind * each : kind * each + 5] = [1, 2j, -1, 0.5, 1j]
        drive = kept.drive(z)
        np.testing.assert_allclose(drive[here], sign * drive[there], atol=1e-12)


def test_an_array_without_mirror_symmetry_is_not_split_into_kinds():
    array, pair = TransducerArray.autd3(), Placement.grid(columns=2, rows=1)
    tilted = replace(pair, rotation=np.array([[0, 0, 0], [0, 0.2, 0]])).array()
    assert of(tilted) is None
    assert of(replace(array, response=np.linspace(0.9, 1.1, array.count).astype(complex))) is None
    assert of(array, replace(GRID, centre=(0.02, 0.0))) is None, "beside the middle"


def test_one_kind_is_the_modes_as_they_are():
    rng = np.random.default_rng(0)
    kept = modes(rng.standard_normal((5, 9)) + 1j * rng.standard_normal((5, 9)))
    z = rng.standard_normal(5) + 1j * rng.standard_normal(5)
    np.testing.assert_allclose(full_phase(kept).drive(z), kept.V @ z)


@pytest.mark.long
def test_phases_by_symmetry_are_as_good():
    """A spot that moves and swings; where it is faint, 1 % of its field is in modes that are left out."""
    pytest.importorskip("numba")
    array = TransducerArray.autd3()
    at, frame = GRID.position, np.arange(60)
    x = 0.01 * np.sin(2 * np.pi * frame / 50)[:, None]
    p = np.exp(-((at[:, 0] - x) ** 2 + at[:, 1] ** 2) / (2 * 0.011**2)) * (0.6 + 0.4 * np.sin(frame))[:, None]
    for peak, most in ((800, 0.02), (4000, 0.12)):
        problem, error = multi_plane_problem([GRID.position], peak * p, array, acoustics=AIR), []
        for kept in (None, of(array)):
            tracker = Live().begin(problem, folded=kept)
            phase = np.array([tracker.follow(each) for each in problem.amplitude])
            error.append(error_of(problem, phase)[10:].mean())
        assert error[0] < most, peak
        assert error[1] < 1.05 * error[0] + 0.01, peak
