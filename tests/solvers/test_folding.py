"""Recordings solved on an array that is folded by its mirrors; the array as a whole is the reference."""

from dataclasses import replace
from functools import partialmethod

import numpy as np
import pytest

from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.settings import best_mode
from midair.solvers import Guard, error_of, solve_parts
from midair.solvers.backend import backend
from midair.solvers.field_operators import FieldOperators
from midair.solvers.mirror_symmetry import KINDS, FoldedProduct, Lattice, Product, mirror_images, modes_by_kind
from midair.solvers.solve_plan import SolvePlan

ARRAY, GRID, SETTINGS = TransducerArray.autd3(), ControlGrid(), best_mode().solver
RNG = np.random.default_rng(5)
CORNER = (np.indices((16, 16)).reshape(2, -1).T - 7.5) * 10.5e-3
SQUARE = TransducerArray(
    position=np.pad(CORNER, ((0, 0), (0, 1))),
    normal=np.tile([0.0, 0, 1], (256, 1)),
    unit=np.zeros(256, int),
    pressure=8.0,
)
MEASURED = replace(ARRAY, response=RNG.uniform(0.7, 1.2, ARRAY.count) * np.exp(1j * RNG.uniform(-1, 1, ARRAY.count)))


def rows(*shape):
    return np.asarray(RNG.normal(size=shape) + 1j * RNG.normal(size=shape))


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def wave(frames, grid=GRID, array=ARRAY, start=0):
    """A spot that moves and swings, at a strength of .15, from a frame on."""
    time, at = np.arange(start, start + frames)[:, None] / 400, grid.position - [*grid.centre, 0]
    x = 0.01 * np.sin(2 * np.pi * time)
    spot = np.exp(-((at[:, 0] - x) ** 2 + at[:, 1] ** 2) / (2 * 0.009**2)) * (0.6 + 0.4 * np.sin(25 * time))
    return AmplitudeFrames(amplitude=0.15 * focus_amplitude(grid, array) * spot, rate=4000.0, grid=grid)


def test_products_by_kind_are_those_of_the_whole_matrix(subtests):
    for precision in ["double", "single"]:
        for array in [ARRAY, MEASURED]:
            with subtests.test(array=array.alike, precision=precision):
                own_backend = backend("numpy", precision=precision)
                lattice, put = Lattice.of(array), own_backend.put
                _, V = modes_by_kind(transfer_matrix(GRID, lattice.array), 5e-3)
                dense = lattice.weight * np.einsum("ki,kmn->kmin", KINDS, V).reshape(V.shape[0] * V.shape[1], -1)
                product = FoldedProduct.of(own_backend, V / 2, lattice.weight)
                b, q, theta = rows(3, len(dense)), rows(3, dense.shape[1]), RNG.uniform(-3, 3, (3, dense.shape[1]))
                close(product.of_modes(put(b)), b @ dense)
                close(product.to_modes(put(q)), q @ dense.conj().T)
                held, a = product.phasors(put(theta))
                close(a, np.exp(1j * theta) @ dense.conj().T)
                close(product.slope(held, put(b)), np.imag(np.exp(-1j * theta) * (b @ dense)))
                root, some = RNG.uniform(1, 2, len(dense)), np.array([3, 8, 100])
                every = (np.arange(4)[:, None] * V.shape[2] + some).reshape(-1)
                sampled = product.sampled(some, put(root))
                close(sampled.of_modes(put(b)), (b / root) @ dense[:, every])
                whole = Product(backend=own_backend, matrix=put(dense), back=put(dense.conj().T))
                close(whole.sampled(every, put(root)).to_modes(put(q[:, every])), sampled.to_modes(put(q[:, every])))


def test_a_lattice_has_the_fields_of_its_array():
    lattice, theta = Lattice.of(MEASURED), RNG.uniform(-3, 3, (2, 1008))
    field = np.exp(1j * lattice.phase(theta)) @ transfer_matrix(GRID, MEASURED).T
    close((lattice.weight * np.exp(1j * theta)) @ transfer_matrix(GRID, lattice.array).T, field)


def test_fields_by_kind_and_their_cost_are_those_of_the_array(subtests):
    for pitch in [6e-3, 5.5e-3]:
        with subtests.test(pitch=pitch):
            target, ring = wave(3, array=MEASURED), Guard(margin=25e-3, pitch=pitch)
            plan = SolvePlan.of(target, MEASURED, SETTINGS.but(guard=ring))
            asked, theta = plan.scene.problem(1.0, plan.settings), RNG.uniform(-3, 3, (3, 1008))
            operators = FieldOperators.of(asked, backend("numpy", precision="double"), tolerance=1e-6, memory=4)
            _, a = operators.drive.phasors(theta)
            q = plan.scene.lattice.weight * np.exp(1j * theta)
            close(operators.points.of_modes(a), q @ asked.G.T)
            # The cost of windows where the target is, from samples about the middle of the lattice, and of the ring.
            batch = operators.batch(np.arange(3), faintest=1e-12)
            cost, _ = operators.phase_function(batch)(theta)
            played = plan.scene.lattice.phase(theta)
            own = replace(plan.own.problem(1.0), cells=plan.own.cells(SETTINGS.means))
            y = np.exp(1j * played) @ transfer_matrix(asked_ring(plan), MEASURED).T / plan.own.focus
            above = np.maximum(np.abs(y) - ring.ceiling * asked.amplitude.max(axis=1, keepdims=True), 0)
            outside = (above**2).sum(axis=1) / 2 / (asked.amplitude**2).sum(axis=1)
            np.testing.assert_allclose(cost, error_of(own, played) ** 2 / 2 + outside, rtol=0.02)


def asked_ring(plan):
    return plan.settings.ring.points(GRID, plan.scene.lattice.middle)


def test_a_folded_array_needs_no_ring_which_is_nowhere_farther_from_the_square():
    middle = Lattice.of(ARRAY).middle
    assert 0.1e-3 < np.abs(middle).max() < 1e-3
    moved, plain = SETTINGS.ring.points(GRID, middle), SETTINGS.ring.points(GRID)
    np.testing.assert_allclose(np.sort(moved[:, 0] - middle[0]), np.sort(middle[0] - moved[:, 0]), atol=1e-12)
    for axis, side in ((0, 1), (0, -1), (1, 1), (1, -1)):
        nearest = [(side * points[:, axis])[side * points[:, axis] > 28e-3].min() for points in (moved, plain)]
        assert nearest[0] <= nearest[1] + 1e-12
    plan = SolvePlan.of(wave(2), ARRAY, SETTINGS, guard=None)
    assert plan.scene.lattice is not None
    assert plan.solve(wave(2), None, None)[0].error.max() < 0.05


def test_mirror_images_are_in_order_and_share_places_on_a_mirror():
    points = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1], [0, 2], [0, -2], [0, 0.0]]) * 1e-3 + [0.0, 0.5]
    index, share = mirror_images(points, (0.0, 0.5))
    np.testing.assert_array_equal(index, [[0, 4, 6], [1, 4, 6], [2, 5, 6], [3, 5, 6]])
    np.testing.assert_array_equal(share, [1, 0.5, 0.25])
    assert mirror_images(points[1:], (0.0, 0.5)) is None
    assert mirror_images(points[:0], (0.0, 0.5))[0].shape == (4, 0)
    assert mirror_images(points, (0.0, 0.0)) is None


def about(ring, middle, grid, own=None, *, points=Guard.points):
    """Points of a ring about the middle of the array, also where none is given."""
    return points(ring, grid, own or middle)


@pytest.mark.long
def test_the_error_is_that_of_the_array_as_a_whole(monkeypatch, subtests):
    """Under the same guard; phases that differ by 1 rad cost 3 % of the mean, and the worst frame is better.

    On the square, the worst frame is .5 to 1.3 times as bad by chance: its median of twelve signals is judged.
    """
    for array, starts, mean, worst in [
        (ARRAY, [0], 1.02, 0.9),
        (MEASURED, [0], 1.03, 0.9),
        (SQUARE, range(0, 1200, 100), 0.95, 1.0),
    ]:
        with subtests.test(mean=mean):
            found = []
            for start in starts:
                target = wave(300 if len(starts) == 1 else 100, array=array, start=start)
                plan = SolvePlan.of(target, array, SETTINGS)
                assert plan.scene.lattice is not None
                folded = plan.solve(target, None, None)[0].error
                with monkeypatch.context() as patched:
                    patched.setattr(Guard, "points", partialmethod(about, Lattice.of(array).middle))
                    found.append((folded, replace(plan, scene=plan.own).solve(target, None, None)[0].error))
            folded, whole = np.swapaxes(found, 0, 1)
            assert folded.mean() < mean * whole.mean()
            assert np.median(folded.max(axis=1) / whole.max(axis=1)) < worst


@pytest.mark.long
def test_bad_frames_are_refined_further():
    target = wave(200)
    errors, made = [], []
    for rescue in (0, 12):
        settings = replace(SETTINGS, method=replace(SETTINGS.method, rescue=rescue))
        solution = SolvePlan.of(target, ARRAY, settings).solve(target, None, None)[0]
        errors.append(solution.error)
        made.append(solution.iterations.sum())
    assert errors[1].max() < 0.95 * errors[0].max()
    assert made[0] < made[1] < 1.2 * made[0]


@pytest.mark.long
def test_parts_jobs_and_blocks_do_not_change_a_bit():
    target = wave(150)
    settings = [
        replace(SETTINGS, method=replace(SETTINGS.method, coarse=16, block=32, opening=32, jobs=jobs))
        for jobs in (1, 2)
    ]
    one, two = (SolvePlan.of(target, ARRAY, each).solve(target, None, None)[0] for each in settings)
    parts = np.concatenate([part.drive.phase for part in solve_parts(target, ARRAY, settings[0])])
    np.testing.assert_array_equal(two.drive.phase, one.drive.phase)
    np.testing.assert_array_equal(parts, one.drive.phase)


def test_other_settings_keep_the_array_as_a_whole():
    others = {"fit": "points", "quiet_palm": 1.0, "backend": "strict", "method": "fast", "amplitudes": "bounded"}
    for name, value in others.items():
        assert SolvePlan.of(wave(2), ARRAY, SETTINGS, **{name: value}).scene.lattice is None, name


@pytest.mark.long
def test_arrays_without_symmetry_and_points_off_the_middle_keep_the_array_as_a_whole():
    beside = replace(GRID, centre=(0.01, 0.0))
    assert SolvePlan.of(wave(2, beside), ARRAY, SETTINGS).scene.lattice is None
    odd = TransducerArray(position=ARRAY.position[:-1], normal=ARRAY.normal[:-1])
    assert SolvePlan.of(wave(2), odd, SETTINGS).scene.lattice is not None  # one more empty place
    half = TransducerArray(position=ARRAY.position[:700], normal=ARRAY.normal[:700])
    assert SolvePlan.of(wave(2), half, SETTINGS).scene.lattice is None
