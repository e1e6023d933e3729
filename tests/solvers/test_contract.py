"""Contract tests of every solver in `METHODS` on every problem."""

import pickle
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from tests.solvers.conftest import random_matrix

from midair.errors import InputError
from midair.solvers import METHODS, Fast, Free, Problem, SolverSettings, error_of, one_blas_thread, solver, takes
from midair.solvers.problem import CellTarget, GuardField
from midair.solvers.terms.amplitudes import doubled, halves

pytestmark = pytest.mark.filterwarnings("error")


def of(G, amplitude, **rest):
    return Problem(G=G, amplitude=np.atleast_2d(np.asarray(amplitude, float)), **rest)


def reachable():
    """Targets that are fields of known phases, so that E = 0 is possible."""
    G = random_matrix(9, 60)
    theta = np.random.default_rng(1).uniform(-np.pi, np.pi, (3, 60))
    return of(G, np.abs(np.exp(1j * theta) @ G.T))


def rank_deficient():
    G = random_matrix(12, 30)
    G[6:] = G[:6] * np.exp(1j * np.arange(6))[:, None]
    return of(G, 0.1 * np.ones((2, 12)))


G = random_matrix(8, 24)
PROBLEMS = {
    "reachable": reachable(),
    "all zero": of(G, np.zeros((2, 8))),
    "silence between": of(G, [[0.1] * 8, [0] * 8, [0.05] * 8]),
    "silence first": of(G, [[0] * 8, [0.1] * 8]),
    "one point of many": of(G, [0, 0.2, 0, 0, 0, 0, 0, 0]),
    "all points": of(G, np.full(8, 0.1)),
    "ten times too strong": of(G, np.full(8, 10.0)),
    "a billionth": of(G, np.full(8, 1e-9)),
    "as good as nothing": of(G, np.full((2, 8), 1e-90)),
    "from loud to nothing": of(G, np.full((3, 8), 0.1) * np.array([[1], [1e-30], [1]])),
    "rank deficient": rank_deficient(),
    "points twice": of(np.repeat(G[:1], 4, axis=0), [0.1, 0.1, 0.1, 0.1]),
    "dead transducers": of(np.where(np.arange(24) % 2, G, 0), np.full(8, 0.1)),
    "a point in the dark": of(np.where(np.arange(8)[:, None] == 3, 0, G), np.full(8, 0.1)),
    "one transducer": of(random_matrix(5, 1), np.full(5, 0.2)),
    "one point": of(random_matrix(1, 20), [0.05]),
    "one of each": of(np.array([[0.5j]]), [0.3]),
    "half level": of(G, np.full((2, 8), 0.05), level=0.5),
}


def guarded(problem):
    ring = random_matrix(5, problem.transducers, seed=9)
    return replace(problem, guard=GuardField(G=ring, ceiling=0.3, weight=1.0))


def by_cells(problem):
    weights = np.eye(problem.points)[::2] + 0.5 * np.eye(problem.points, k=1)[::2]
    return replace(problem, cells=CellTarget(weights=weights, wanted=problem.amplitude**2 @ weights.T))


def by_windows(problem):
    """Overlapping means with band-limited weights, some negative, of a pressure with non-negative weights."""
    near, far = np.eye(problem.points), np.eye(problem.points, k=1) + np.eye(problem.points, k=-1)
    wanted = problem.amplitude**2 @ (near + 0.5 * far).T
    return replace(problem, cells=CellTarget(weights=near + 0.6 * far - 0.1 * far @ far, wanted=wanted, faint=1e-3))


def smoothed(problem):
    return replace(problem, smooth=1e-2)


def in_two_airs(problem):
    """The same again with a slightly longer wavelength: phases changed linearly over the transducers."""
    slope = np.exp(0.3j * np.linspace(-1, 1, problem.transducers))
    guard = problem.guard
    return replace(
        problem,
        G=np.concatenate([problem.G, problem.G * slope]),
        amplitude=np.tile(problem.amplitude, (1, 2)),
        psi=None if problem.psi is None else np.tile(problem.psi, 2),
        guard=None if guard is None else replace(guard, G=np.concatenate([guard.G, guard.G * slope])),
    )


WITH = {
    "guard": guarded,
    "cells": by_cells,
    "windows": by_windows,
    "smooth": smoothed,
    "robust": in_two_airs,
    "amplitudes": doubled,
    "all": lambda problem: doubled(smoothed(by_cells(guarded(problem)))),
    "all, robust": lambda problem: doubled(in_two_airs(smoothed(guarded(problem)))),
}
"""Functions that add a term to a problem."""

POINTS = {"guard", "smooth", "amplitudes"}
NEEDED = {"windows": {"cells"}, "all": POINTS | {"cells"}, "all, robust": POINTS | {"robust"}}
"""Terms that a method needs for those that are not terms themselves."""

TAKERS = {term: [name for name in METHODS if NEEDED.get(term, {term}) <= takes(name)] for term in WITH}
"""The methods that take each term."""

FEW = {name: solver(name) for name in METHODS} | {
    "fast": Fast(iterations=4, more_iterations=8, field_iterations=20),
    "free": Free(iterations=12),
}


def on_each(names, check):
    """Call the check with each problem and raise all failures, each with the name of its problem."""
    failures = []
    for name in names:
        try:
            check(PROBLEMS[name])
        except Exception as failure:  # noqa: BLE001 - it is raised below
            failure.add_note(f"on the problem {name!r}")
            failures.append(failure)
    if failures:
        raise ExceptionGroup("some problems fail", failures)


@pytest.fixture(params=list(METHODS), ids=str)
def method(request):
    if request.param == "live":
        request.getfixturevalue("live_kernel")
    return request.param


def test_never_fails_and_never_gives_nan(method):
    on_each(PROBLEMS, lambda problem: solve_and_check(method, problem))


def solve_and_check(method, problem):
    with one_blas_thread():
        answer = solver(method).solve(problem)
    frames = len(problem.amplitude)
    assert answer.phase.shape == (frames, problem.transducers)
    assert np.isfinite(answer.phase).all()
    assert np.isfinite(error_of(problem, answer.phase, answer.level)).all()
    assert answer.level is None or (answer.level.min() >= 0 and answer.level.max() <= 1)
    silent = ~problem.amplitude.any(axis=1)
    assert [status == "silent" for status in answer.status] == list(silent)
    assert not answer.iterations[silent].any()
    assert (answer.iterations[~silent] >= 0).all()


def test_no_term_makes_it_fail_or_give_nan(method):
    """Each problem with each term, and each method with each term that it takes, in few iterations: shared out."""
    for term in WITH:
        takers = TAKERS[term]
        shared = [name for number, name in enumerate(PROBLEMS) if takers[number % len(takers)] == method]
        on_each(shared, lambda plain, term=term: solve_with_term(FEW[method], term, plain))


def solve_with_term(method, term, plain):
    problem = WITH[term](plain)
    answer = method.solve(problem)
    assert np.isfinite(answer.phase).all()
    phase, level = answer.phase, answer.level
    if problem.transducers != plain.transducers:
        phase, level = halves(phase)
        assert 0 <= level.min() <= level.max() <= 1
    here = plain if problem.points != plain.points else replace(problem, G=plain.G)
    assert np.isfinite(error_of(here, phase, level)).all()
    assert [status == "silent" for status in answer.status] == list(~plain.amplitude.any(axis=1))


ASKED = {
    "amplitudes": {"amplitudes": "bounded"},
    "guard": {"guard": 0.02},
    "cells": {"fit": "cells"},
    "smooth": {"smooth": 0.01},
    "robust": {"robust": 1.0},
    "quiet-ears": {"quiet_ears": 3.0},
    "quiet-palm": {"quiet_palm": 0.1},
}
"""Settings that switch each term on."""


def test_unsupported_terms_are_refused(subtests):
    for method, (term, changes) in product(METHODS, ASKED.items()):
        with subtests.test(method=method, term=term):
            settings = SolverSettings(method=method, **changes)
            assert settings.asked == {term}
            if term in takes(method):
                settings.check()
            else:
                with pytest.raises(InputError, match=rf"method {method}: .* got {term}; choose .*fast"):
                    settings.check()


WORST = {"lm": 1e-3, "fast": 0.02, "free": 0.02, "live": 0.1}
"""Largest error at a field that exists."""


def test_it_repeats_itself_keeps_its_input_reports_its_progress_and_finds_a_field_that_exists(method):
    problem, seen = PROBLEMS["reachable"], []
    G, amplitude = problem.G.copy(), problem.amplitude.copy()
    first = solver(method).solve(problem)
    second = solver(method).solve(problem, progress=lambda *now: seen.append(now))
    np.testing.assert_array_equal(first.phase, second.phase)
    np.testing.assert_array_equal(problem.G, G)
    np.testing.assert_array_equal(problem.amplitude, amplitude)
    assert seen[-1] == (3, 3)
    silent = solver(method).solve(PROBLEMS["silence between"])
    np.testing.assert_array_equal(silent.phase[1], silent.phase[0])
    if method in WORST:
        assert error_of(problem, first.phase, first.level).max() < WORST[method]
        # One point with a twentieth of the possible field: every phase pattern with the right sum is a solution.
        answer = solver(method).solve(PROBLEMS["one point"])
        assert error_of(PROBLEMS["one point"], answer.phase, answer.level)[0] < 0.02


def test_every_name_makes_its_method_with_the_iterations_and_start_that_it_has():
    for name in METHODS:
        assert solver(name) == METHODS[name]()
    assert (solver("lm", iterations=(7, 3), start="zero").iterations, solver("lm", start="zero").start) == (7, "zero")
    assert solver("lm", iterations=4).warm_iterations == 4
    assert solver("fast", iterations=4, start="previous").iterations == 4


def test_settings_are_an_ordinary_class():
    made = SolverSettings(method=Fast(batch=3), guard=np.float32(0.02), quiet_palm=np.float32(0.1), jobs=4)
    assert pickle.loads(pickle.dumps(made)) == made == replace(made, jobs=None)
    assert (made.ring.margin, made.quiet[0].weight) == (pytest.approx(0.02), pytest.approx(0.1))
    assert made.asked == {"guard", "quiet-palm"}
