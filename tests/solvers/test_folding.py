"""Products by kinds of mirror symmetry are those of the whole matrix, and solutions by them are as true."""

from dataclasses import replace

import numpy as np
import pytest

from midair.model import Acoustics, Board, ControlGrid, Placement, TransducerArray, array_of_boards
from midair.solvers import Fast, Glide, error_of, multi_plane_problem, place_grid, prepared
from midair.solvers.backend import backend
from midair.solvers.field_operators import FieldOperators
from midair.solvers.folding import Folded
from midair.solvers.lbfgs import LBFGS
from midair.solvers.terms import QuietPalm
from midair.solvers.terms.amplitudes import doubled

ARRAY, GRID = TransducerArray.autd3(), ControlGrid()
MEASURED = replace(
    ARRAY, response=np.exp(np.random.default_rng(1).normal(0, 0.1, (996, 2)) @ [1, 1j]) * (np.arange(996) > 2)
)
BOARDS = array_of_boards(Board.nominal(), Board.nominal())


def problem_of(array, points=GRID.position, frames=32):
    """Random patterns of 4 x 4 smooth spots over the plane."""
    away = points[:, :2] - points[:, :2].mean(axis=0)
    places = np.stack(np.meshgrid(*[np.linspace(-0.015, 0.015, 4)] * 2), axis=-1).reshape(16, 2)
    spots = np.exp(-((away[None] - places[:, None]) ** 2).sum(axis=2) / (2 * 0.007**2))
    p = 1500 * np.random.default_rng(3).integers(0, 2, (frames, 16)) @ spots
    return multi_plane_problem([points], p, array, acoustics=Acoustics())


def quiet(problem):
    rows = multi_plane_problem([QuietPalm().points(GRID)], np.zeros((1, len(QuietPalm().points(GRID)))), ARRAY).G
    return problem.with_quiet(rows / np.sqrt(len(rows)), 0.1)


TILTED = place_grid(GRID, centre=(0.0, 0.0, 0.2), normal=(0.2, 0.0, 1.0))
PROBLEMS = {
    "2 x 2": lambda: problem_of(ARRAY),
    "3 x 1": lambda: problem_of(Placement.grid(columns=3, rows=1).array()),
    "measured, three dead": lambda: problem_of(MEASURED),
    "two boards": lambda: problem_of(BOARDS, GRID.position - [0, 0, 0.08]),
    "tilted palm": lambda: problem_of(ARRAY, TILTED),
    "two amplitudes": lambda: doubled(problem_of(ARRAY)),
    "quiet": lambda: quiet(problem_of(ARRAY)),
}


@pytest.mark.parametrize("name", list(PROBLEMS))
def test_products_by_kinds_are_those_of_the_matrix(name):
    problem, there = PROBLEMS[name](), backend("numpy", precision="double")
    folded, whole = (FieldOperators.of(problem, there, tolerance=5e-3, memory=4, fold=fold) for fold in (True, False))
    assert isinstance(folded.kinds, Folded)
    q = np.exp(1j * np.random.default_rng(0).uniform(0, 7, (3, problem.transducers)))
    spread = np.ones((3, folded.kinds.columns), complex)
    spread[:, folded.seat] = q
    G = problem.G if problem.guard is None else np.concatenate([problem.G, problem.guard.G])
    made, right = folded.kinds_field.ahead(folded.kinds.back(spread)), q @ G.T
    assert np.linalg.norm(made - right) < 5e-3 * np.linalg.norm(right)
    assert np.linalg.norm(folded.drive.back(spread) - whole.drive.back(q)) < 0.1 * np.linalg.norm(whole.drive.back(q))
    # The adjoint, which gives the slope.
    y = np.random.default_rng(1).normal(size=(3, len(G))) + 0j
    slope = folded.kinds.ahead(folded.kinds_field.back(y))
    np.testing.assert_allclose(np.vdot(spread, slope), np.vdot(made, y), rtol=1e-9)


def test_an_array_without_symmetry_or_far_from_the_points_is_not_folded():
    turned = Placement.grid(columns=2, rows=1)
    turned = replace(turned, rotation=np.array([[0, 0, 0], [0, 0.2, 0.0]])).array()
    aside = replace(GRID, centre=(0.05, 0.05)).position
    unknown = replace(problem_of(MEASURED), response=None)
    costly = replace(problem_of(ARRAY), position=None)
    for problem in (problem_of(turned), problem_of(ARRAY, aside), unknown, costly):
        operators = FieldOperators.of(problem, backend("numpy"), tolerance=5e-3, memory=4)
        assert not isinstance(operators.kinds, Folded)
        assert operators.kinds.columns == problem.transducers


@pytest.mark.long
@pytest.mark.parametrize("method", [Fast(), Glide(coarse=8)], ids=["fast", "glide"])
@pytest.mark.parametrize("name", ["2 x 2", "measured, three dead", "two amplitudes"])
def test_solutions_by_kinds_are_as_true(name, method):
    problem = PROBLEMS[name]()
    folded, whole = (
        error_of(problem, replace(method, fold=fold).solve(problem).phase).mean() for fold in (True, False)
    )
    assert folded < 1.02 * whole


@pytest.mark.long
def test_other_libraries_fold_alike():
    problem = problem_of(ARRAY, frames=2)
    method = Fast(iterations=4, more_iterations=0, field_iterations=4, precision="double")
    ours, theirs = (replace(method, backend=name).solve(problem).phase for name in ("numpy", "strict"))
    np.testing.assert_allclose(np.exp(1j * theirs), np.exp(1j * ours), atol=1e-6)


def test_compiled_descent_is_that_of_numpy():
    pytest.importorskip("numba")
    problem = PROBLEMS["2 x 2"]()
    operators = FieldOperators.of(problem, backend("numpy"), tolerance=5e-3, memory=4)
    batch = operators.batch(np.arange(8), faintest=1e-12)
    theta = np.random.default_rng(2).uniform(-9, 9, (8, operators.kinds.columns)).astype(np.float32)
    function, step = operators.phase_function(batch), 1 / (operators.strongest * batch.gain[:, 0]) ** 2
    assert type(operators.descent) is not LBFGS
    ours, theirs = (each.run(function, theta, step, 6) for each in (operators.descent, LBFGS(memory=4)))
    for name in ("x", "cost", "gradient"):
        right = getattr(theirs, name)
        assert np.abs(getattr(ours, name) - right).max() < 2e-4 * np.abs(right).max()


class Shelf:
    def __init__(self):
        self.kept, self.reads = {}, 0

    def read(self, key):
        self.reads += key in self.kept
        return self.kept.get(key)

    def write(self, key, arrays):
        self.kept[key] = arrays


def test_modes_are_made_once_for_a_matrix(monkeypatch):
    shelf, made = Shelf(), []
    monkeypatch.setattr(prepared, "_kept", {})
    monkeypatch.setattr(prepared, "_stores", [])
    prepared.keep_modes_in(shelf)

    def make():
        made.append(1)
        return {"x": np.arange(3)}

    for matrix in (np.ones(2), np.ones(2), np.ones(2, np.float32), np.zeros(2)):
        prepared.prepared((matrix, None, 1e-2), make)
    assert len(made) == len(shelf.kept) == 3
    monkeypatch.setattr(prepared, "_kept", {})
    assert prepared.prepared((np.ones(2), None, 1e-2), make)["x"].tolist() == [0, 1, 2]
    assert len(made) == 3
    assert shelf.reads == 1
